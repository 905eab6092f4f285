"""AxiLiteSlave: its parameters. Its behaviour is proved in tests/lab/proof/test_bus.py, and shown by the benches."""

import pytest

from strapdown.bus import Access, AxiLiteSlave, Field, Register

TABLE = (Register("FLAGS", 0x00, (Field("bad", 0, 1, Access.CLEAR, ""),), ""),
         Register("INPUT", 0x04, (Field("value", 0, 32, Access.WRITE, ""),), ""),
         Register("TIME", 0x08, (Field("value", 0, 8, Access.READ, ""),), ""))


def test_members_are_those_of_the_fields():
    slave = AxiLiteSlave(TABLE, ("FLAGS", "bad"), loaded=("INPUT",))
    assert {"flags_bad", "input", "time", "load", "locked", "awaddr", "rdata"} <= {*slave.signature.members}
    # What sets the flag is inside.
    assert "flags_bad_set" not in slave.signature.members
    assert "load" not in AxiLiteSlave(TABLE, ("FLAGS", "bad")).signature.members
    assert (len(slave.field("TIME")), len(slave.field("FLAGS", "bad"))) == (8, 1)


@pytest.mark.parametrize(("options", "message"), [
    ({"error_response": "decerr"}, "error_response must be slverr or okay, not 'decerr'"),
    ({"loaded": ["TIME"]}, "register TIME cannot be loaded: it does not keep what is written"),
])
def test_errors(options, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        AxiLiteSlave(TABLE, ("FLAGS", "bad"), **options)
