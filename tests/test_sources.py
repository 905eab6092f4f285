"""Every text file is read and written in UTF-8, whatever the locale of the machine."""

import ast

import pytest

FOLDERS = ("hw", "sim", "scripts", "tests")

OTHERS = {"os", "tarfile", "gzip"}
"""Modules with an ``open`` of another kind."""


def without_encoding(source):
    """Lines of calls that read, write or open a text file in the encoding of the locale."""
    for call in ast.walk(ast.parse(source)):
        match call:
            # The metadata of a distribution are UTF-8.
            case ast.Call(func=ast.Attribute(value=ast.Call(func=ast.Name(id="distribution")), attr="read_text")):
                continue
            case ast.Call(func=ast.Attribute(attr="read_text" | "write_text")):
                pass
            case ast.Call(func=ast.Attribute(value=ast.Name(id=owner), attr="open")) if owner in OTHERS:
                continue
            # The first argument of a path's ``open`` is its mode; others open a device, say.
            case ast.Call(func=ast.Attribute(attr="open"), args=[first, *_]) if not isinstance(first, ast.Constant):
                continue
            case ast.Call(func=ast.Attribute(attr="open") | ast.Name(id="open"), args=arguments):
                if any("b" in word.value for word in arguments
                       if isinstance(word, ast.Constant) and isinstance(word.value, str)):
                    continue
            case _:
                continue
        if all(keyword.arg != "encoding" for keyword in call.keywords):
            yield call.lineno


@pytest.mark.parametrize("folder", FOLDERS)
def test_text_files_have_an_encoding(root, folder):
    found = [f"{path.relative_to(root)}:{line}" for path in sorted((root / folder).rglob("*.py"))
             for line in without_encoding(path.read_text(encoding="utf-8"))]
    assert found == []


@pytest.mark.parametrize(("source", "lines"), [
    ("path.read_text()", [1]),
    ("\npath.write_text(text)", [2]),
    ("open(name)", [1]),
    ("path.open('w', newline='')", [1]),
    ("path.read_text(encoding='utf-8')", []),
    ("path.open('rb')", []),
    ("os.open(name, flags)", []),
    ("device.open(map)", []),
    ("distribution('strapdown').read_text('LICENSE')", []),
    ("path.open()", [1]),
])
def test_calls_without_an_encoding_are_found(source, lines):
    assert list(without_encoding(source)) == lines
