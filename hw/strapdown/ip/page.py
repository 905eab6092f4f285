"""The page of a register table, in Markdown."""

from strapdown.ascii import ascii_text
from strapdown.bus import MAP_VERSION, TABLE_SIZE, RegisterTable
from strapdown.markdown import markdown_table

__all__ = ["register_tables", "text"]


def text(table: RegisterTable) -> str:
    """Markdown page of a table, in ASCII: an overview of the registers, and the fields of those that have several."""
    return _ascii_lines(
        f"# Registers of {table.name}\n\n"
        f"{table.title[0].upper()}{table.title[1:]}; configuration {table.configuration}. {register_tables(table, 2)}")


def register_tables(table: RegisterTable, level: int) -> str:
    """Version, overview and fields of a table in Markdown; the fields of a register have a title of this level."""
    overview = markdown_table(
        ("offset", "register", "access", "reset", "meaning"),
        ((f"`{register.address:#05x}`", f"`{register.name}`", _access(register), f"`{register.reset:#010x}`",
          register.meaning) for register in table))
    several = [register for register in table if len(register.fields) > 1]
    sections = "".join(f"\n{'#' * level} {register.name}\n\n{_fields(register)}\n" for register in several)
    return (f"Version {MAP_VERSION >> 16}.{MAP_VERSION & 0xffff} of the layout. The registers have 32 bits each, in a "
            f"range of {TABLE_SIZE} bytes. Bits without a field read 0, and a write to them has no effect. No read has "
            f"a side effect.\n\n{overview}\n{sections}")


def _ascii_lines(text):
    """A text in ASCII with its line breaks."""
    return "\n".join(ascii_text(line) for line in text.split("\n"))


def _access(register):
    """The access of all fields of a register, or nothing if they differ."""
    accesses = {field.access for field in register.fields}
    return accesses.pop().value if len(accesses) == 1 else "by field"


def _fields(register):
    """Table of the fields of a register."""
    return markdown_table(
        ("bits", "field", "access", "reset", "meaning"),
        ((str(field.low) if field.width == 1 else f"{field.high}:{field.low}", f"`{field.name}`", field.access.value,
          field.reset, field.meaning) for field in register.fields))
