"""The IP-XACT memory map that PeakRDL makes of the SystemRDL text; it needs the packages of ``strapdown[ip]``."""

from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from .places import Vlnv

__all__ = ["INSTALLATION", "installed", "text"]

INSTALLATION = "pip install 'strapdown[ip]'"
"""The command that installs the packages."""


def installed() -> bool:
    """Whether the packages are installed."""
    return all(find_spec(package) for package in ("systemrdl", "peakrdl_ipxact"))


def text(rdl: str, vlnv: Vlnv) -> str:
    """IP-XACT of IEEE 1685-2009 with the memory map of a SystemRDL text."""
    from peakrdl_ipxact import IPXACTExporter, Standard
    from systemrdl import RDLCompiler

    with TemporaryDirectory() as folder:
        source, made = Path(folder) / "table.rdl", Path(folder) / "table.xml"
        source.write_text(rdl, encoding="ascii")
        compiler = RDLCompiler()
        compiler.compile_file(str(source))
        exporter = IPXACTExporter(vendor=vlnv.vendor, library=vlnv.library, version=vlnv.version,
                                  standard=Standard.IEEE_1685_2009)
        exporter.export(compiler.elaborate().top, str(made), component_name=vlnv.name)
        return made.read_text(encoding="utf-8")
