#!/usr/bin/env bash
# Print the path of a Python that Blender's `bpy` module exists for.
#
#   find_python.sh              the newest that is found: on the PATH, or among pyenv's
#   find_python.sh 3.11         the same, of that version (one of the supported)
#   find_python.sh PROGRAM      that program, if its version is a supported one
set -euo pipefail

supported=(3.13 3.11) # Blender 5.1 and later; Blender 5.0

# Print the interpreter behind $1 (not a shim, not a virtual environment) if its version is $2 and it can make environments.
interpreter() {
    "$1" - "$2" 2>/dev/null <<'PYTHON'
import sys, ensurepip, venv
if "%d.%d" % sys.version_info[:2] != sys.argv[1]:
    sys.exit(1)
print(getattr(sys, "_base_executable", sys.executable))
PYTHON
}

find_version() {
    local candidate
    for candidate in "python$1" python3 python; do
        interpreter "$candidate" "$1" && return
    done
    while read -r candidate; do
        interpreter "$candidate" "$1" && return
    done < <(ls -d "${PYENV_ROOT:-$HOME/.pyenv}/versions/$1".*/bin/python 2>/dev/null | sort -Vr)
    return 1
}

wanted=${1:-}
if [[ -z $wanted || " ${supported[*]} " == *" $wanted "* ]]; then
    for version in ${wanted:-"${supported[@]}"}; do
        find_version "$version" && exit
    done
    echo "No Python ${wanted:-3.13 or 3.11} with venv and pip found. Install Python ${wanted:-3.13}" \
        "(with pyenv, from python.org, or your distribution's python${wanted:-3.13}-venv)," \
        "or name one: make PYTHON=/path/to/python …" >&2
else
    for version in "${supported[@]}"; do
        interpreter "$wanted" "$version" && exit
    done
    echo "PYTHON=$wanted is no Python 3.13 or 3.11 with venv and pip; bpy is published for these versions only." >&2
fi
exit 1
