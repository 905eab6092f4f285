"""Tests of packages, drivers and software; the package of a small core is written once for each worker."""

import pytest

from strapdown.cores import CONFIGS, QUATERNION_J3, axi_core
from strapdown.ip import write_package

from .packages import Package


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """`make test-ip` brings all tools, so none of its tests may be skipped."""
    report = yield
    if report.skipped and item.get_closest_marker("ip"):
        report.outcome = "failed"
    return report


@pytest.fixture(scope="session")
def packages(tmp_path_factory):
    """The Package of a configuration, by name and options of ``axi_core``; each is written once."""
    written = {}

    def package(name, **options):
        key = name, *options.items()
        if key not in written:
            config = CONFIGS[name]
            folder = tmp_path_factory.mktemp(name)
            top = axi_core(config, **options)
            written[key] = Package(write_package(top, config, folder / "package", command=""), top)
        return written[key]
    return package


@pytest.fixture(scope="session")
def package(packages):
    """The package of a small core with streams."""
    return packages(QUATERNION_J3.name)
