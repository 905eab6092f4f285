"""The C header and the Python map: every register, constant and field, as a compiler and an interpreter see them."""

import re
import runpy
import shutil
import subprocess
from dataclasses import replace

import pytest

from strapdown.bus import TABLE_SIZE, Access
from strapdown.cores import FLIGHT, QUATERNION_J2, SINS, THESIS, THESIS_X8, main_module
from strapdown.cores.registers import register_table
from strapdown.ip import c_header, driver_files, python_map
from strapdown.ip.c_header import DRIVER_TABLE, driver_table

STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
CONFIGS = {config.name: config for config in (THESIS, THESIS_X8, FLIGHT, QUATERNION_J2, SINS)}


@pytest.fixture(scope="module", params=CONFIGS)
def table(request, make_core):
    """The register table of a configuration."""
    config = CONFIGS[request.param]
    return register_table(make_core(main_module(config), config), config)


@pytest.fixture(scope="module")
def thesis_table(make_core):
    """The register table of the thesis's core."""
    return register_table(make_core(main_module(THESIS), THESIS), THESIS)


def printed(folder, name, text, expressions):
    """The values of expressions of C, which include a header."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: the C header is not compiled.")
    (folder / f"{name}.h").write_text(text, encoding="ascii")
    lines = "".join(f'    printf("%llu\\n", (unsigned long long)({expression}));\n' for expression in expressions)
    (folder / "main.c").write_text(f'#include <stdio.h>\n#include "{name}.h"\n#include "{name}.h"\n'
                                   f"int main(void)\n{{\n{lines}    return 0;\n}}\n", encoding="ascii")
    done = subprocess.run(["gcc", *STRICT, "-o", folder / "main", folder / "main.c"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [int(line) for line in subprocess.run([folder / "main"], capture_output=True, check=True).stdout.split()]


def expected(table):
    """Maps expressions of C to their values, from the table alone."""
    name, capitals = table.name, table.name.upper()
    values = {f"sizeof(struct {name})": TABLE_SIZE}
    for register in table:
        values[f"offsetof(struct {name}, {register.name.lower()})"] = register.address
        for field in register.fields:
            if field.access is Access.CONSTANT:
                values[f"{capitals}_{register.name}_VALUE"] = field.reset
            elif field.width < 32:
                macro = f"{capitals}_{register.name}_{field.name.upper()}"
                values |= {f"{macro}_MASK": field.mask, f"{macro}_SHIFT": field.low}
    for kind, words in {"sample": table.samples, "parameters": table.parameters, "outputs": table.outputs}.items():
        for word in words:
            if word.format in ("binary32", "binary64"):
                first = 4 * [register for each in words for register in each.registers].index(word.registers[0])
                values[f"offsetof(union {name}_{kind}, value.{word.port})"] = first
    return values


def test_header_has_every_register(table, tmp_path):
    values = expected(table)
    assert printed(tmp_path, table.name, c_header.text(table), values) == list(values.values())


def test_header_of_the_driver_has_every_register_of_all_cores(table, tmp_path):
    values = expected(driver_table(table))
    assert printed(tmp_path, DRIVER_TABLE, c_header.text(driver_table(table)), values) == list(values.values())
    assert "STRAPDOWN_REGISTERS_CONFIGURATION_VALUE" not in values


def test_cores_share_the_header_of_the_driver(make_core):
    tables = [register_table(make_core(main_module(config), config), config) for config in CONFIGS.values()]
    headers = {driver_files(table)[f"{DRIVER_TABLE}.h"] for table in tables}
    assert headers == {c_header.text(driver_table(tables[0]))}


def test_inputs_and_outputs_stand_in_a_row(table):
    """The driver, and the unions, rely on it."""
    for words in table.samples, table.parameters, table.outputs:
        addresses = [register.address for word in words for register in word.registers]
        assert addresses == list(range(addresses[0], addresses[0] + 4 * len(addresses), 4)) if addresses else True


def test_a_comment_cannot_end_early(thesis_table, tmp_path):
    text = c_header.text(replace(thesis_table, title="a µ*/ int b;"))
    assert printed(tmp_path, thesis_table.name, text, ["1"]) == [1]


def test_map_of_python_has_every_register(table, tmp_path):
    path = tmp_path / f"{table.name}_map.py"
    path.write_text(python_map.text(table), encoding="ascii")
    found = runpy.run_path(str(path))
    assert found["REGISTERS"] == {register.name: register.address for register in table}
    assert found["CONSTANTS"]["CONFIGURATION"] == table["CONFIGURATION"].reset
    for register in table.common:
        for field in register.fields:
            low, width = found["FIELDS"][register.name][field.name]
            assert ((1 << width) - 1) << low == field.mask
    ports = [*found["SAMPLES"], *found["PARAMETERS"], *found["OUTPUTS"]]
    assert ports == [(word.port, word.registers[0].address, len(word.registers), word.format)
                     for word in (*table.inputs, *table.outputs)]
    assert (found["NAME"], found["CONFIGURATION"]) == (table.name, table.configuration)


def test_no_driver_has_an_offset_of_its_own(root):
    """The numbers in drivers are codes, bits and bytes of words, and a number of polls."""
    python = [root / "hw/strapdown" / name for name in ("device.py", "pynq.py", "uio.py")]
    drivers = [path for path in (root / "hw/strapdown/ip").glob("*/*") if path.suffix in (".c", ".h")]
    assert {path.name for path in drivers} >= {"strapdown.c", "strapdown_uio.c"}
    for path in (*drivers, *python):
        code = re.sub(r"/\*.*?\*/|\"\"\".*?\"\"\"", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        numbers = {int(word, 0) for word in re.findall(r"\b(0x[0-9a-fA-F_]+|[0-9_]*\d)\b", code)}
        assert numbers <= {*range(9), 16, 32, 0xFFFF_FFFF, 100_000}, path
