#!/usr/bin/env bash
# make_venv.sh FOLDER PYTHON REQUIREMENTS …
#
# Bring FOLDER, a virtual environment, up to date: made anew if it was made by another Python, and the packages of each
# REQUIREMENTS file installed if the file changed since. PYTHON is what find_python.sh accepts, or empty.
set -euo pipefail
cd "$(dirname "$0")/.."
venv=$1
python=$(scripts/find_python.sh "$2")
identity=$("$python" -c 'import sys; print(sys.base_prefix, sys.version)')

if [[ ! -x $venv/bin/python || $(cat "$venv/made-by.stamp" 2>/dev/null) != "$identity" ]]; then
    echo "Making $venv with $python"
    "$python" -m venv --clear "$venv"
    echo "$identity" >"$venv/made-by.stamp"
fi

# The root package under its extension id, for tools that read its imports (see pyproject.toml) and for Blender as a
# repository of extensions.
mkdir -p "$venv/link"
ln -sfn "$PWD" "$venv/link/irradiance_vector_grid"

for requirements in "${@:3}"; do
    # The stamp is the copy of what was installed.
    cmp -s "$requirements" "$venv/$requirements" && continue
    echo "Installing $requirements into $venv"
    "$venv/bin/python" -m pip --disable-pip-version-check --no-input \
        install --quiet --require-hashes --only-binary :all: -r "$requirements"
    cp "$requirements" "$venv/$requirements"
done
