#!/bin/sh
# Install the compiler for the Cortex-A9, its emulator and the device-tree compiler from Debian if one is missing and this
# user may; say so before.
missing=
for tool in arm-linux-gnueabihf-gcc qemu-arm dtc; do command -v $tool >/dev/null || missing="$missing $tool"; done
[ -z "$missing" ] && exit 0
packages="gcc-arm-linux-gnueabihf libc6-dev-armhf-cross qemu-user device-tree-compiler"
if [ "$(id -u)" = 0 ]; then sudo=; else sudo="sudo -n"; fi
if command -v apt-get >/dev/null && { [ -z "$sudo" ] || $sudo true 2>/dev/null; }; then
    echo "Installing$missing for the whole system, as root: apt-get install $packages"
    $sudo apt-get update -q >/dev/null && $sudo apt-get install -q -y --no-install-recommends $packages >/dev/null
else
    echo "Missing:$missing. Only root can install them, on Debian: apt-get install $packages"
    exit 1
fi
