#!/bin/sh
# Install Icarus Verilog from Debian if it is missing and this user may; say so before; never fail.
command -v iverilog >/dev/null && exit 0
if [ "$(id -u)" = 0 ]; then sudo=; else sudo="sudo -n"; fi
if command -v apt-get >/dev/null && { [ -z "$sudo" ] || $sudo true 2>/dev/null; }; then
    echo "Installing Icarus Verilog for the whole system, as root: apt-get install iverilog"
    { $sudo apt-get update -q && $sudo apt-get install -q -y --no-install-recommends iverilog; } >/dev/null 2>&1
    command -v iverilog >/dev/null || echo "Icarus Verilog could not be installed: its tests are skipped."
else
    echo "Icarus Verilog is missing, and only root can install it, on Debian: its tests are skipped."
fi
exit 0
