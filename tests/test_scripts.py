"""The scripts that the Makefile calls."""

import subprocess

import pytest

SAYS = "Installing Icarus Verilog for the whole system, as root: apt-get install iverilog"


@pytest.fixture
def machine(tmp_path):
    """A function that makes commands, each from a shell line, and runs the installation of Icarus with them.

    It returns the output, with the actions of the commands, and the exit status.
    """
    def run(**commands):
        for name, line in commands.items():
            path = tmp_path / name.replace("_", "-")
            path.write_text(f"#!/bin/sh\n{line}\n", encoding="utf-8")
            path.chmod(0o755)
        log = tmp_path / "log"
        log.touch()
        with log.open("a", encoding="utf-8") as output:
            done = subprocess.run(["/bin/sh", "scripts/install_icarus.sh"], stdout=output, check=False,
                                  env={"PATH": str(tmp_path), "LOG": str(log)})
        return log.read_text(encoding="utf-8").splitlines(), done.returncode
    return run


def test_an_installation_is_told_before_it_is_made(machine, root, monkeypatch):
    monkeypatch.chdir(root)
    assert machine(id="echo 0", apt_get='echo "did $*" >> $LOG') == (
        [SAYS, "did update -q", "did install -q -y --no-install-recommends iverilog",
         "Icarus Verilog could not be installed: its tests are skipped."], 0)


@pytest.mark.parametrize("commands", [
    {"id": "echo 0"}, {"id": "echo 1000", "apt_get": "echo did >> $LOG"},
    {"id": "echo 1000", "apt_get": "echo did >> $LOG", "sudo": "exit 1"}])
def test_without_debian_or_root_nothing_is_tried(machine, root, monkeypatch, commands):
    monkeypatch.chdir(root)
    assert machine(**commands) == (
        ["Icarus Verilog is missing, and only root can install it, on Debian: its tests are skipped."], 0)


def test_where_it_is_there_nothing_is_said(machine, root, monkeypatch):
    monkeypatch.chdir(root)
    assert machine(iverilog="", id="echo 0", apt_get="echo did >> $LOG") == ([], 0)
