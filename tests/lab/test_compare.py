"""Comparison with a commit: the generator that runs is the commit's own, and the table marks what got worse."""

import json
import subprocess

import pytest
from click.testing import CliRunner

from strapdown.cli import main
from strapdown_lab import commands
from strapdown_lab.report import compare as module
from strapdown_lab.report.compare import CommitError, comparison_table, earlier_circuits
from strapdown_lab.report.cores import CORES
from strapdown_lab.synthesis import Ecp5Placement, Xc7Resources

ENTRY = next(entry for entry in CORES if entry.config.name == "quaternion_j2")

GENERATOR = """
import json, sys
from pathlib import Path
name, module, folder = sys.argv[3], sys.argv[5], Path(sys.argv[7])
if name != "quaternion_j2":
    sys.exit(f"strapdown: no configuration is called {name!r}")
folder.mkdir(parents=True)
(folder / f"{module}.v").write_text(f"// a comment\\nmodule {module}();\\nendmodule\\n")
(folder / f"{module}.json").write_text(json.dumps({"latency_cycles": 77}))
"""
"""A generator of long ago: ``generate --config NAME --module MODULE --output FOLDER``."""


@pytest.fixture
def repository(tmp_path):
    """A repository with the generator above in its only commit, and another one in the folder."""
    def git(*words):
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@example.org", *words], cwd=tmp_path, check=True,
                       capture_output=True)

    package = tmp_path / "hw" / "strapdown"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "__main__.py").write_text(GENERATOR, encoding="utf-8")
    git("init")
    git("add", ".")
    git("commit", "-m", "generator")
    (package / "__main__.py").write_text("raise SystemExit('the folder, not the commit')\n", encoding="utf-8")
    return tmp_path


def test_the_generator_of_the_commit_runs(repository, tmp_path):
    (circuit,) = earlier_circuits("HEAD", [ENTRY], tmp_path / "out", repository=repository)
    assert (circuit.config, circuit.module, circuit.cycles) == ("quaternion_j2", ENTRY.module, 77)
    assert circuit.verilog == f"module {ENTRY.module}();\nendmodule\n"


def test_a_configuration_that_the_commit_lacks_is_left_out(repository, tmp_path):
    thesis = next(entry for entry in CORES if entry.config.name == "thesis")
    assert earlier_circuits("HEAD", [thesis], tmp_path / "out", repository=repository) == []


def test_an_unknown_commit_and_a_generator_that_fails_are_one_line(repository, tmp_path):
    with pytest.raises(CommitError, match=r"^'nothing' is no commit of this repository that has a folder hw$"):
        earlier_circuits("nothing", [ENTRY], tmp_path / "out", repository=repository)
    subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@example.org", "commit", "-am", "broken"],
                   cwd=repository, check=True, capture_output=True)
    with pytest.raises(CommitError, match=r"^HEAD does not generate \w+ of quaternion_j2: the folder, not the commit$"):
        earlier_circuits("HEAD", [ENTRY], tmp_path / "out", repository=repository)


@pytest.mark.parametrize("line", ["numpy-of-long-ago>=2", "pydantic[email]>=2"])
def test_packages_that_a_commit_needs_are_named(repository, tmp_path, line):
    (repository / "pyproject.toml").write_text(
        f'[project]\ndependencies = ["numpy", "pydantic[timezone]", "{line}"]\n', encoding="utf-8")
    for words in (["add", "."], ["-c", "user.name=a", "-c", "user.email=a@example.org", "commit", "-m", "needs"]):
        subprocess.run(["git", *words], cwd=repository, check=True, capture_output=True)
    with pytest.raises(CommitError) as caught:
        earlier_circuits("HEAD", [ENTRY], tmp_path / "out", repository=repository)
    assert str(caught.value) == f"HEAD needs packages that are not installed: pip install '{line}'"


@pytest.mark.parametrize(("old", "new", "cell"), [
    (1000, 1009, "1,000 → 1,009 (+0.9%)"), (1000, 1011, "**1,000 → 1,011 (+1.1%)**"),
    (1000, 900, "1,000 → 900 (-10.0%)")])
def test_more_luts_than_the_limit_are_marked(old, new, cell):
    row = {"config": "a", "before": {"lut": old}, "after": {"lut": new}}
    assert comparison_table([row]).splitlines()[-1].split(" | ")[2] == cell


@pytest.mark.parametrize(("old", "new", "cell"), [
    (100.0, 95.1, "100.0 → 95.1 (-4.9%)"), (100.0, 94.9, "**100.0 → 94.9 (-5.1%)**"),
    (100.0, 110.0, "100.0 → 110.0 (+10.0%)")])
def test_a_lower_frequency_than_the_limit_is_marked(old, new, cell):
    row = {"config": "a", "before": {"mhz": old}, "after": {"mhz": new}}
    assert comparison_table([row]).splitlines()[-1].split(" | ")[-1].removesuffix(" |") == cell


def test_command(monkeypatch, tmp_path):
    """Both circuits are measured with every seed; the results of the tools are invented."""
    asked = []

    def place(verilog, top, cache, *, seeds):
        asked.append(seeds)
        return Ecp5Placement(1, 1, 0, 0, tuple(80.0 + seed for seed in seeds), ("a", "b"))

    earlier = module.Circuit("quaternion_j2", ENTRY.module, 70, "module a(); endmodule")
    monkeypatch.setattr(commands, "earlier_circuits", lambda commit, entries, folder: [earlier])
    monkeypatch.setattr(module, "synthesise_xc7", lambda verilog, top, cache: Xc7Resources(len(verilog), 0, 1, 2, 1))
    monkeypatch.setattr(module, "place_ecp5", place)
    words = ["compare", "HEAD", "--config", "quaternion_j2", "--seeds", "3", "--output", str(tmp_path / "out"),
             "--build", str(tmp_path)]
    result = CliRunner().invoke(main, words, catch_exceptions=False)
    assert result.output.split() == [str(tmp_path / "out" / "compare.md")]
    assert asked == [(1, 2, 3), (1, 2, 3)]
    (row,) = json.loads((tmp_path / "out" / "compare.json").read_text(encoding="utf-8"))["cores"]
    assert row["before"] == {"cycles": 70, "lut": len(earlier.verilog), "ff": 1, "dsp": 2, "bram": 1, "mhz": 82.0,
                             "mhz_of_seeds": [81.0, 82.0, 83.0]}
    assert row["after"]["cycles"] == ENTRY.make().latency
    assert "| `quaternion_j2` | 70 → " in (tmp_path / "out" / "compare.md").read_text(encoding="utf-8")
