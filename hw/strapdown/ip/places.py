"""The name of a core among other people's cores, and the places of the files in its package."""

from dataclasses import dataclass

from strapdown.bus import MAP_VERSION

__all__ = ["Places", "Vlnv"]


@dataclass(frozen=True)
class Vlnv:
    """Vendor, library, name and version of a core.

    The version is that of its register layout, because software that finds a core by its VLNV must know the layout.
    """

    name: str
    vendor: str = "strapdown"
    library: str = "navigation"
    version: str = f"{MAP_VERSION >> 16}.{MAP_VERSION & 0xffff}"

    def __str__(self):
        return f"{self.vendor}:{self.library}:{self.name}:{self.version}"

    @property
    def identifier(self):
        """Name and version in one word, as in ``INS_top_axi_v1_0``."""
        return f"{self.name}_v{self.version.replace('.', '_')}"


@dataclass(frozen=True)
class Places:
    """Paths of the files in the package of a module, relative to its folder.

    Attributes
    ----------
    name : str
        The Verilog module.
    """

    name: str

    @property
    def vlnv(self):
        """The name of the core."""
        return Vlnv(self.name)

    @property
    def hdl(self):
        """Folder of the Verilog file, of its description and of its lint rules."""
        return "hdl"

    @property
    def verilog(self):
        """The Verilog file."""
        return f"hdl/{self.name}.v"

    @property
    def lint(self):
        """Lint rules of Verilator that the Verilog breaks."""
        return f"hdl/{self.name}.vlt"

    @property
    def component(self):
        """The IP-XACT component, which Vivado reads."""
        return "component.xml"

    @property
    def gui(self):
        """Tcl of the dialogue in which Vivado shows the core."""
        return f"xgui/{self.vlnv.identifier}.tcl"

    @property
    def clock_alone(self):
        """Constraint of the clock while the core is synthesised alone."""
        return f"constraints/{self.name}_ooc.xdc"

    @property
    def guide(self):
        """The product guide."""
        return f"doc/{self.name}.md"

    @property
    def blocks(self):
        """Its block diagram."""
        return f"doc/{self.name}.svg"

    @property
    def peakrdl(self):
        """The registers as a memory map of IP-XACT, by PeakRDL."""
        return f"registers/{self.name}.xml"

    @property
    def bench(self):
        """The self-checking bench."""
        return f"bench/{self.name}_tb.v"

    @property
    def vectors(self):
        """What the bench writes and expects, which it reads as ``$readmemh`` does."""
        return f"bench/{self.name}_tb.hex"

    @property
    def sources(self):
        """Folder of the C sources of the driver in a Vivado project."""
        return f"drivers/{self.vlnv.identifier}/src"

    @property
    def data(self):
        """Folder of the description of the driver."""
        return f"drivers/{self.vlnv.identifier}/data"
