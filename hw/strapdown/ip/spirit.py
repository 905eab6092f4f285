"""Elements of IEEE 1685-2009, the IP-XACT that Vivado reads."""

from xml.etree import ElementTree

__all__ = ["SPIRIT", "XILINX", "document", "element", "xilinx"]

SPIRIT = "http://www.spiritconsortium.org/XMLSchema/SPIRIT/1685-2009"
"""Namespace of IP-XACT."""

XILINX = "http://www.xilinx.com"
"""Namespace of Vivado's extensions."""

for prefix, namespace in (("spirit", SPIRIT), ("xilinx", XILINX)):
    ElementTree.register_namespace(prefix, namespace)


def element(tag, *content, **attributes):
    """An element of IP-XACT with a text, or with elements inside, and with attributes of IP-XACT."""
    return _element(SPIRIT, tag, content, attributes)


def xilinx(tag, *content, **attributes):
    """An element of Vivado's extensions, like ``element``."""
    return _element(XILINX, tag, content, attributes)


def document(root):
    """Text of a document with a root element. Equal bytes on every run."""
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _element(namespace, tag, content, attributes):
    made = ElementTree.Element(f"{{{namespace}}}{tag}",
                               {f"{{{namespace}}}{name}": str(value) for name, value in attributes.items()})
    for part in content:
        if isinstance(part, ElementTree.Element):
            made.append(part)
        else:
            made.text = str(part)
    return made
