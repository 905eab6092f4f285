"""Results are made once for each set of inputs."""

import pytest

from strapdown_sim.cache import Cache, digest


def test_a_result_is_made_once_for_equal_inputs(tmp_path):
    cache, made = Cache(tmp_path / "cache"), []

    def make(path):
        made.append(path)
        path.write_text(f"answer {len(made)}", encoding="utf-8")

    first = cache.file({"a": 1, "b": [2]}, ".json", make)
    assert cache.file({"b": [2], "a": 1}, ".json", make) == first
    assert cache.file({"a": 1, "b": [3]}, ".json", make) != first
    assert first.read_text(encoding="utf-8") == "answer 1"
    assert len(made) == 2


def test_a_result_that_was_cut_off_is_made_again(tmp_path):
    cache = Cache(tmp_path)

    def cut_off(path):
        path.write_text("half", encoding="utf-8")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cache.file({}, ".json", cut_off)
    whole = cache.file({}, ".json", lambda path: path.write_text("answer", encoding="utf-8"))
    assert whole.read_text(encoding="utf-8") == "answer"


def test_digest_is_the_published_one():
    """FIPS 180-4, example of one block."""
    assert digest("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert digest("a", "b") != digest("ab")
