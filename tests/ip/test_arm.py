"""The driver's object for the Cortex-A9 in an emulator, whose loads and stores move the circuit."""

import re

import numpy as np
import pytest

from strapdown.cores import THESIS

from .support import assert_answers, build, run, tool
from .test_driver import updates

pytestmark = pytest.mark.ip

COMPILER = "arm-linux-gnueabihf-gcc"
FLAGS = ("-mcpu=cortex-a9", "-static")
EMULATOR = ("qemu-arm", "-cpu", "cortex-a9")
TEXT_BYTES = 1024
"""Most bytes of the driver."""


def text_size(path):
    """Bytes of code and constants of an object; it must have no data, and need no function of another file."""
    text, data, bss = map(int, tool("arm-linux-gnueabihf-size", path).splitlines()[1].split()[:3])
    assert (data, bss, tool("arm-linux-gnueabihf-nm", "--undefined-only", path)) == (0, 0, "")
    return text


@pytest.mark.parametrize("mode", ["-mthumb", "-marm"])
def test_loads_and_stores_move_the_circuit(make_bus, tmp_path, mode):
    """200 updates with random stalls, as whole words, with outputs of the twin."""
    top, model = make_bus(THESIS)
    table = top.component.table
    samples, answers = updates(top, 200)
    program, driver = build(table, tmp_path, ["trap.c"], *FLAGS, mode, compiler=COMPILER)
    assert text_size(driver) <= TEXT_BYTES
    words, done = run(program, model, samples, before=EMULATOR, seed=9, stalls=30)
    assert done.returncode == 0, done.stderr
    assert_answers(words, answers)
    loads, stores = map(int, re.fullmatch(rb"(\d+) loads, (\d+) stores\n", done.stderr).groups())
    # An update stores its sample, start, flags and snapshot; open stores the enabled interrupts.
    assert stores == len(samples) * (table.sample_words + 3) + 1
    assert loads > len(samples) * (table.answer_words + 5)
    print(f"{len(samples)} updates, {loads} loads, {stores} stores")


def test_stores_of_bytes_are_refused(make_bus, tmp_path):
    top, model = make_bus(THESIS)
    program, _ = build(top.component.table, tmp_path, ["trap.c"], *FLAGS, compiler=COMPILER, program="packed.c")
    words, done = run(program, model, np.zeros(0), before=EMULATOR)
    assert (words.size, done.returncode) == (0, 5)
    assert re.match(rb"refused: not a load or store of a word, code [0-9a-f]{8}, register 00c\n", done.stderr)
