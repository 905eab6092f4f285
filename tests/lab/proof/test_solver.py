"""Messages of proofs if a tool is missing."""

from click.testing import CliRunner

from strapdown_lab.proof import solver
from strapdown_lab.proof.__main__ import main
from strapdown_lab.proof.solver import solver_missing


def test_missing_tool_is_one_line(monkeypatch):
    monkeypatch.setattr(solver, "EXECUTABLES", {"z3": "no-such-solver"})
    message = "no-such-solver not installed: 'make formal' installs what is missing"
    assert solver_missing() == message
    result = CliRunner().invoke(main, ["formal", "--only", "^FpSelect"])
    assert (result.exit_code, result.stderr) == (1, f"Error: {message}\n")
