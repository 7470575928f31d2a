#!/usr/bin/env bash
# Install, on Debian and its kin, the system libraries that Blender's module links (X11, GL) and those that give it
# OpenGL without a screen or a graphics card (EGL, Mesa); or the packages that are named. Installs only what is missing;
# never fails for want of rights.
set -uo pipefail

packages=(libx11-6 libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1 libgl1-mesa-dri)
(($#)) && packages=("$@")

if ! command -v dpkg-query >/dev/null; then
    echo "Not a Debian system: if 'import bpy' fails or tests are skipped, install the equivalents of ${packages[*]}"
    exit 0
fi

missing=()
for package in "${packages[@]}"; do
    [[ $(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null) == installed ]] || missing+=("$package")
done
((${#missing[@]})) || exit 0

if ((EUID == 0)); then
    as_root=(env)
elif sudo -n true 2>/dev/null; then
    as_root=(sudo -n)
else
    echo "Missing packages, and no rights to install them. If 'import bpy' fails or tests are skipped:"
    echo "    sudo apt-get install ${missing[*]}"
    exit 0
fi

apt_install() {
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install --yes --quiet --no-install-recommends "${missing[@]}" </dev/null
}

echo "Installing ${missing[*]}"
apt_install || { "${as_root[@]}" apt-get update --quiet && apt_install; } ||
    echo "Could not install ${missing[*]}: going on without"
exit 0
