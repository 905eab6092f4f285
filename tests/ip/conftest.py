"""Tests of packages, drivers and software."""

import pytest


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """`make test-ip` brings all tools, so none of its tests may be skipped."""
    report = yield
    if report.skipped and item.get_closest_marker("ip"):
        report.outcome = "failed"
    return report
