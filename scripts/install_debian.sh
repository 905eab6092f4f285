#!/bin/sh
# Install packages of Debian if a program of theirs is missing and this user may; say so before. Arguments: PROGRAM=PACKAGE.
missing= packages=
for pair in "$@"; do
    packages="$packages ${pair#*=}"
    command -v "${pair%%=*}" >/dev/null || missing="$missing ${pair%%=*}"
done
[ -z "$missing" ] && exit 0
if [ "$(id -u)" = 0 ]; then sudo=; else sudo="sudo -n"; fi
if command -v apt-get >/dev/null && { [ -z "$sudo" ] || $sudo true 2>/dev/null; }; then
    echo "Installing$missing for the whole system, as root: apt-get install$packages"
    $sudo apt-get update -q >/dev/null 2>&1
    $sudo apt-get install -q -y --no-install-recommends $packages >/dev/null
else
    echo "Missing:$missing. Only root can install them, on Debian: apt-get install$packages"
    exit 1
fi
