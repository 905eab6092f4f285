"""The table of faults fits the sources, and a fault that the tests do not detect is reported."""

import pytest

from strapdown_lab.proof import mutation
from strapdown_lab.proof.mutants import MUTANTS, Mutant


def test_every_fragment_occurs_once(root):
    assert [f"{count} times in {mutant.file}: {mutant.fragment}"
            for mutant, count in mutation.misplaced(root / "hw" / "strapdown")] == []


def test_faults_change_something_and_have_tests(root):
    assert len(MUTANTS) >= 40
    for mutant in MUTANTS:
        assert mutant.fragment != mutant.replacement
        assert (root / "tests" / mutant.test_file).is_file()


@pytest.mark.parametrize("folder", ["fp", "cordic"])
def test_every_operator_has_faults(root, folder):
    operators = {f"{folder}/{path.name}" for path in (root / "hw" / "strapdown" / folder).glob("*.py")
                 if "def elaborate" in path.read_text(encoding="utf-8")}
    assert operators
    assert operators <= {mutant.file for mutant in MUTANTS}


def test_fragment_must_occur_once():
    mutant = Mutant("fp/add.py", "a", "b", "")
    assert mutation.mutated("xay", mutant) == "xby"
    with pytest.raises(ValueError, match=r"^fp/add\.py contains this 2 times, not once: a$"):
        mutation.mutated("aa", mutant)


def test_verdicts(tmp_path):
    """A small project: one fault is detected, one is not, and tests must pass without faults."""
    for name, text in {
        "pyproject.toml": "[tool.pytest.ini_options]\naddopts = '--import-mode=importlib'\n",
        "hw/strapdown/fp/__init__.py": "", "hw/strapdown/__init__.py": "",
        "hw/strapdown/fp/add.py": "def add(a, b):\n    # sum\n    return a + b\n",
        "tests/fp/test_add.py": "from strapdown.fp.add import add\n\n\ndef test_add():\n    assert add(2, 3) == 5\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    noticed = Mutant("fp/add.py", "a + b", "a - b", "subtracts")
    survivor = Mutant("fp/add.py", "# sum", "# difference", "nothing")
    verdicts = mutation.run([noticed, survivor], tmp_path)
    assert [verdict.killed for verdict in verdicts] == [True, False]
    assert verdicts[0].by == "FAILED tests/fp/test_add.py::test_add"

    (tmp_path / "hw/strapdown/fp/add.py").write_text(
        "def add(a, b):\n    # sum\n    return a * b + 0 * (a + b)\n", encoding="utf-8")
    with pytest.raises(RuntimeError, match="must pass without a fault"):
        mutation.run([noticed], tmp_path)
