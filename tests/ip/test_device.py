"""The driver in Python, and the class for /dev/uio: words, and accesses to a file in place of the registers."""

import importlib.util
import struct

import numpy as np
import pytest

from strapdown.cores import THESIS, THESIS_X8, main_module
from strapdown.cores.registers import register_table
from strapdown.device import Driver, DriverError, from_words, to_words
from strapdown.ip.python_map import text
from strapdown.uio import Uio


def test_words_are_those_of_memory():
    ports = (("a", 0, 1, "binary32"), ("b", 4, 2, "binary64"), ("c", 12, 1, "bits"), ("d", 16, 1, "binary16"))
    values = {"a": [1.1, np.nan], "b": [-2.2, 1e300], "c": [7, -1], "d": [0.5, -1.5]}
    words = to_words(ports, values)
    for index, row in enumerate(words):
        a, b, c, d = (values[port][index] for port in "abcd")
        assert row.tobytes() == struct.pack("<fdIeH", a, b, c & 0xFFFF_FFFF, d, 0)
    back = from_words(ports, words)
    assert np.array_equal(back["a"], np.float32(values["a"]), equal_nan=True)
    assert np.array_equal(back["b"], values["b"])
    assert np.array_equal(back["c"], [7, 0xFFFF_FFFF])
    assert np.array_equal(back["d"], values["d"])
    assert to_words(ports, {"a": 1.1, "b": 0, "c": 0, "d": 0}).shape == (1, 5)


@pytest.fixture(params=[THESIS, THESIS_X8], ids=lambda config: config.name)
def map(request, make_core, tmp_path):
    """The map of a core, imported."""
    table = register_table(make_core(main_module(request.param), request.param), request.param)
    path = tmp_path / "core_map.py"
    path.write_text(text(table), encoding="ascii")
    spec = importlib.util.spec_from_file_location("core_map", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_accesses_to_a_device(map, tmp_path):
    """A file has the words that a core would have, and gets those that the driver writes."""
    registers = np.zeros(map.SIZE // 4, "<u4")

    def at(name):
        return map.REGISTERS[name] // 4

    for name, value in map.CONSTANTS.items():
        registers[at(name)] = value
    registers[at("UPDATES")] = 8
    registers[at("SNAPSHOT_UPDATE")], registers[at("SNAPSHOT_STATUS")] = 9, 0b101
    registers[at("OUT_C11")] = np.float32(0.25).view("<u4")
    registers[at("INTERRUPT_FLAGS")] = 0b10101
    path = tmp_path / "uio0"
    path.write_bytes(registers.tobytes())

    core = Uio(path, map)
    core.start({port: index + 0.5 for index, (port, *_) in enumerate(map.SAMPLES)})
    with pytest.raises(DriverError, match="the update did not finish"):
        core.wait(3)
    written = np.frombuffer(path.read_bytes(), "<u4")
    for index, (_, offset, _, _) in enumerate(map.SAMPLES):
        assert written[offset // 4] == np.float32(index + 0.5).view("<u4")
    assert written[at("CONTROL")] == 1
    update = core.snapshot()
    assert (update.number, update.status) == (9, ("accelerometer_missing", "refused"))
    assert update.outputs["out_c11"] == np.float32(0.25)
    core.enable("finish", "overrun")
    assert core.interrupt(1) == ("finish", "overrun")
    assert core.read(map.REGISTERS["INTERRUPT_FLAGS"]) == 0b101
    several = "CHANNEL" in map.REGISTERS
    with pytest.raises(DriverError, match=f"INS_top\\w* has no channel 8: it has {8 if several else 1}"):
        core.select(8)
    if several:
        core.select(5)
        assert core.read(map.REGISTERS["CHANNEL"]) == 5


def test_a_device_without_a_core(map, tmp_path):
    (tmp_path / "uio0").write_bytes(bytes(map.SIZE))
    with pytest.raises(DriverError, match="there is no core at this address: IDENTITY reads 0x00000000"):
        Uio(tmp_path / "uio0", map)


def test_a_driver_needs_accesses():
    for access in (lambda: Driver().read(0), lambda: Driver().write(0, 0)):
        with pytest.raises(NotImplementedError):
            access()
