"""Generator for FuseSoC: writes a core behind a bus by the command strapdown, which must be installed."""

import re
import subprocess
import sys
from pathlib import Path

import yaml


def generate(request):
    """Writes the package that a request of FuseSoC asks for to the current folder, with the name that it asks for."""
    parameters = dict(request["parameters"])
    config = parameters.pop("config", "")
    if ".py:" in config:
        config = str(Path(request["files_root"]) / config)
    command = ["strapdown", "ip", config, "--output", "."]
    for change in parameters.pop("set", ()):
        command += ["--set", change]
    if not parameters.pop("streams", True):
        command.append("--no-streams")
    command += ["--errors", parameters.pop("errors", "slverr")]
    if parameters:
        sys.exit(f"strapdown: the generator has no parameter {next(iter(parameters))!r}: choose config, set, "
                 "streams or errors")
    subprocess.run(command, check=True)
    core = Path("strapdown.core")
    text = core.read_text(encoding="utf-8")
    core.write_text(re.sub("(?m)^name: .*", f"name: {request['vlnv']}", text), encoding="utf-8")
    # This core is in the library already.
    Path("generator.core").unlink()


if __name__ == "__main__":
    generate(yaml.safe_load(Path(sys.argv[1]).read_text(encoding="utf-8")))
