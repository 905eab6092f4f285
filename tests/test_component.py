"""Described components can be read without becoming a circuit; Amaranth's check for unused components omits them."""

import gc
import warnings

import pytest
from amaranth import Module, UnusedElaboratable
from amaranth.back import rtlil
from amaranth.lib import wiring
from amaranth.lib.wiring import Out

from strapdown.component import Described
from strapdown.fp import BINARY32, FpAdd


class Plain(wiring.Component):
    """A normal component, which Amaranth expects to become a circuit."""

    one: Out(1)

    def elaborate(self, platform):
        m = Module()
        m.d.comb += self.one.eq(1)
        return m


class Free(Described, Plain):
    """The same as a described component."""


def unused(make):
    """True if Amaranth reports a component that is made and not used."""
    gc.collect()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make()
        gc.collect()
    return [warning.category for warning in caught] == [UnusedElaboratable]


def test_only_plain_components_are_reported():
    # Amaranth reports nothing before the first circuit of a process.
    rtlil.convert(Plain(), emit_src=False)
    assert unused(Plain)
    assert not unused(Free)
    assert not unused(lambda: FpAdd(BINARY32).latency)


def test_a_wrong_parameter_is_one_error():
    with pytest.raises(ValueError, match=r"^latency must be from 1 to 8, not 9$"):
        FpAdd(BINARY32, latency=9)


def test_circuits_are_equal():
    free, plain = (rtlil.convert(make(), name="top", emit_src=False) for make in (Free, Plain))
    assert free == plain
