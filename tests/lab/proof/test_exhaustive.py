"""Exhaustive runs: samples agree, a wrong circuit is detected, an interrupted run continues."""

import dataclasses
import json

import pytest

from strapdown.fp import BINARY32, FpToFixed, Rounding
from strapdown_lab.proof import exhaustive
from strapdown_sim.drivers.toolchain import SimulatorMissingError

pytestmark = pytest.mark.verilator

# Around zero, one, the range of integers, infinity and NaN, of either sign.
RANGES = [center - 2048 for center in (0x800, 0x00800000, 0x3F800000, 0x4F000000, 0x7F800000, 0x7FC00000,
                                       0x80000800, 0x80800000, 0xBF800000, 0xCF000000, 0xFF800000)]


@pytest.fixture
def folder(models, tmp_path):
    """Folder of a run's progress; its model goes into the folder of other tests, to share Verilator's runtime."""
    models.mkdir(parents=True, exist_ok=True)
    (tmp_path / "models").symlink_to(models)
    return tmp_path


def run_of(name, folder):
    try:
        return exhaustive.Run(name, folder)
    except SimulatorMissingError as error:
        pytest.skip(str(error))


@pytest.mark.parametrize("name", ["rsqrt", "table_reciprocal_square_root", "to_fixed16", "from_int32"])
def test_samples_agree(name, folder):
    run = run_of(name, folder)
    for first in RANGES:
        assert run.check(first, 4096) == (0, [])


def test_wrong_circuit_is_found_and_run_goes_on(monkeypatch, folder):
    def wrong():
        return FpToFixed(BINARY32, width=32, fraction_bits=0, rounding=Rounding.TOWARD_ZERO)
    subject = dataclasses.replace(exhaustive.RUNS["to_int32"], make=wrong)
    monkeypatch.setitem(exhaustive.RUNS, "to_int32", subject)
    monkeypatch.setattr(exhaustive, "SHARD", 1 << 12)
    run = run_of("to_int32", folder)
    # 0.5 is a tie and is rounded down; the next operands are not.
    mismatches, rows = run.check(0x3F000000, 16)
    assert mismatches == 15
    assert rows[0] == "3f000001 00000000 00000001"

    first, second = run.remaining(exhaustive.fraction(f"2/{exhaustive.SHARDS}"))
    run.keep(first, *run.check(first * exhaustive.SHARD, exhaustive.SHARD))
    stored = json.loads((folder / "to_int32.json").read_text(encoding="utf-8"))
    assert stored["shards"] == [first]
    again = exhaustive.Run("to_int32", folder)
    assert again.remaining(exhaustive.fraction(f"2/{exhaustive.SHARDS}")) == [second]
    assert not again.complete


@pytest.mark.parametrize("text", ["0", "2", "-1/2", "many"])
def test_fraction_out_of_range(text):
    with pytest.raises(ValueError, match=text):
        exhaustive.fraction(text)
