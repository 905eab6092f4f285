"""Descriptions of a register table, read by other programs: SystemRDL, and the page."""

import re

import pytest
from systemrdl import RDLCompiler
from systemrdl.parser.SystemRDLLexer import SystemRDLLexer
from systemrdl.rdltypes import OnWriteType

from strapdown.bus import Access, Field, Register, RegisterTable
from strapdown.cores import CONFIGS, main_module
from strapdown.cores.registers import register_table
from strapdown.ip import page, rdl

CONFIGURATIONS = ("thesis", "thesis_x8", "flight", "quaternion_j3", "sins")


@pytest.fixture(scope="module")
def table_of(make_core):
    """The register table of a named configuration."""
    def table(name):
        config = CONFIGS[name]
        return register_table(make_core(main_module(config), config), config)
    return table


def read(text, folder):
    """The registers of a SystemRDL text, as nodes of systemrdl-compiler."""
    file = folder / "table.rdl"
    file.write_text(text, encoding="ascii")
    compiler = RDLCompiler()
    compiler.compile_file(str(file))
    return list(compiler.elaborate().top.registers())


def access_of(field):
    """The access of a field of systemrdl-compiler."""
    if field.get_property("singlepulse"):
        return Access.PULSE
    if field.get_property("onwrite") is OnWriteType.woclr:
        assert field.is_hw_writable
        assert field.get_property("precedence").name == "hw"
        return Access.CLEAR
    if field.is_sw_writable:
        return Access.WRITE
    return Access.READ if field.is_hw_writable else Access.CONSTANT


def facts(register):
    """What must agree of a register of systemrdl-compiler."""
    return [(register.inst_name, register.absolute_address, register.get_property("regwidth"), field.inst_name,
             field.low, field.width, access_of(field), field.get_property("reset"))
            for field in register.fields()]


def expected(register):
    """The same of a register of a table."""
    return [(register.name, register.address, 32, field.name, field.low, field.width, field.access, field.reset)
            for field in register.fields]


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_rdl_describes_every_field(table_of, name, tmp_path):
    table = table_of(name)
    assert [facts(register) for register in read(rdl.text(table), tmp_path)] == list(map(expected, table))


def test_rdl_names_that_are_words_of_the_language_and_strings_with_quotes(tmp_path):
    fields = tuple(Field(name, bit, 1, Access.READ, 'a "word" \\ at 5 µs')
                   for bit, name in enumerate(("signal", "field", "own", "true", "rw")))
    table = RegisterTable("TEST_axi", "words", "test", (Register("WORDS", 0, fields, "words"),), (), (), ())
    (register,) = read(rdl.text(table), tmp_path)
    assert [field.inst_name for field in register.fields()] == [field.name for field in fields]
    assert next(iter(register.fields())).get_property("desc") == 'a "word" \\ at 5 us'


def test_rdl_keywords_are_those_of_the_compiler():
    literals = {name.strip("'") for name in SystemRDLLexer.literalNames}
    assert {name for name in literals if re.fullmatch(r"[a-z]\w*", name)} == rdl.KEYWORDS


@pytest.mark.parametrize("name", CONFIGURATIONS)
def test_page_names_every_register_and_field(table_of, name):
    text, table = page.text(table_of(name)), table_of(name)
    assert text.isascii()
    for register in table:
        assert f"| `{register.address:#05x}` | `{register.name}` |" in text
        if len(register.fields) > 1:
            section = text.partition(f"\n## {register.name}\n")[2].partition("\n## ")[0]
            assert re.findall(r"\| `(\w+)` \|", section) == [field.name for field in register.fields]
