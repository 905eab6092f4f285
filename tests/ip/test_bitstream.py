"""From clone to bitstream by open tools: the page docs/bitstream.md."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.ip
BIN = Path(sys.executable).parent


def tables(config):
    """Contents of all lookup tables of a configuration of Trellis, with their places; all ones is the default."""
    tiles = re.split(r"^\.tile ", config, flags=re.MULTILINE)[1:]
    return {(tile.split()[0], *word) for tile in tiles
            for word in re.findall(r"^word: (SLICE\S+INIT) ([01]*0[01]*)$", tile, re.MULTILINE)}


def test_bitstream(tmp_path, root):
    """The design reaches the clock of its board, and the bitstream holds all its lookup tables."""
    folder = tmp_path / "bitstream"
    done = subprocess.run([root / "scripts" / "bitstream.sh", folder, BIN], cwd=tmp_path, check=False,
                          capture_output=True, text=True, env=os.environ | {"LC_ALL": "C"})
    assert done.returncode == 0, done.stderr
    (clock,) = json.loads((folder / "timing.json").read_text(encoding="utf-8"))["fmax"].values()
    assert clock["constraint"] == pytest.approx(48, abs=0.01)
    assert clock["achieved"] >= 48
    subprocess.run([BIN / "yowasp-ecpunpack", "board.bit", "back.config"], cwd=folder, check=True, capture_output=True)
    routed, back = (tables((folder / name).read_text(encoding="utf-8")) for name in ("board.config", "back.config"))
    assert routed
    assert routed <= back
