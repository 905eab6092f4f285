"""The driver's object for the Cortex-A9 in an emulator, whose loads and stores move the circuit."""

import re

import numpy as np
import pytest

from strapdown.cores import THESIS
from strapdown.ip import device_tree

from .support import assert_answers, build, run, tool
from .test_driver import updates

pytestmark = pytest.mark.ip

COMPILER = "arm-linux-gnueabihf-gcc"
FLAGS = ("-mcpu=cortex-a9", "-static")
EMULATOR = ("qemu-arm", "-cpu", "cortex-a9")
KERNEL = ("trap.c", "kernel.c", "strapdown_uio.c")
WRAPPED = tuple(f"-Wl,--wrap={call}" for call in ("open", "mmap", "munmap", "read", "write", "poll", "close"))
"""Files and flags for a kernel that is a file of this folder."""
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


def test_interrupts_of_linux(make_bus, tmp_path):
    """The driver for /dev/uio waits for the interrupt of the circuit; tests/ip/kernel.c is the kernel."""
    top, model = make_bus(THESIS)
    samples, answers = updates(top, 50)
    program, _ = build(top.component.table, tmp_path, KERNEL, *FLAGS, *WRAPPED, compiler=COMPILER, program="uio.c")
    words, done = run(program, model, samples, before=EMULATOR, seed=10, stalls=30)
    assert done.returncode == 0, done.stderr
    assert np.array_equal(words.reshape(answers.shape), answers)


def test_device_tree(make_bus, tmp_path):
    """The node compiles, in a tree and as an overlay, to what a Zynq needs."""
    table = make_bus(THESIS)[0].component.table
    node = device_tree.text(table, 0x43C0_0000)
    labels = ("/dts-v1/;\n/ { amba: axi { #address-cells = <1>; #size-cells = <1>; "
              "intc: interrupt-controller {}; }; };\n")
    for name, head in ("tree", labels), ("overlay", "/dts-v1/;\n/plugin/;\n"):
        (tmp_path / f"{name}.dts").write_text(head + node, encoding="ascii")
        tool("dtc", "-q", "-@", "-O", "dtb", "-o", tmp_path / f"{name}.dtb", tmp_path / f"{name}.dts")
    text = tool("dtc", "-q", "-I", "dtb", "-O", "dts", tmp_path / "tree.dtb")
    for line in ("navigation@43c00000 {", 'compatible = "generic-uio";', "reg = <0x43c00000 0x1000>;",
                 "interrupts = <0x00 0x1d 0x04>;"):
        assert line in text


@pytest.mark.parametrize("block", [0, 1], ids=["registers", "linux"])
def test_programs_of_the_page(make_bus, root, tmp_path, block):
    """The programs in C of docs/software.md show the angles of the twin."""
    top, model = make_bus(THESIS)
    page = (root / "docs" / "software.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```c\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    (tmp_path / "main.c").write_text(blocks[block], encoding="ascii")
    samples, answers = updates(top, 40)
    program, _ = build(top.component.table, tmp_path, [*KERNEL, "page.c"], *FLAGS, *WRAPPED, compiler=COMPILER,
                       program="main.c")
    words, done = run(program, model, samples, before=EMULATOR)
    assert done.returncode == 0, done.stderr
    table = top.component.table
    shown = answers[answers[:, -1] & table["SNAPSHOT_STATUS"]["refused"].mask == 0]
    columns = [[word.port for word in table.outputs].index(f"out_{angle}") for angle in ("pitch", "roll", "yaw")]
    assert len(shown) < len(answers)
    assert np.array_equal(words.reshape(-1, 3), shown[:, columns])
