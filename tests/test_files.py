"""Files are written completely or not at all."""

import pytest

from strapdown.files import written_together, written_whole


@pytest.mark.parametrize("is_folder", [False, True])
def test_written_whole_or_not_at_all(tmp_path, is_folder):
    target = tmp_path / "result"

    def write(path, text):
        if is_folder:
            path.mkdir()
            path /= "file"
        path.write_text(text, encoding="utf-8")

    def read():
        return (target / "file" if is_folder else target).read_text(encoding="utf-8")

    with written_whole(target) as partial:
        write(partial, "first")
        assert not target.exists()

    def cut_off():
        with written_whole(target) as partial:
            write(partial, "half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cut_off()
    assert read() == "first"
    with written_whole(target) as partial:
        write(partial, "second")
    assert read() == "second"
    assert [path.name for path in tmp_path.iterdir()] == ["result"]


def test_files_take_their_places_together_or_not_at_all(tmp_path):
    folder = tmp_path / "new" / "folder"

    def write(text, *, cut_off=False):
        with written_together(folder) as partial:
            (partial / "a").write_text(text, encoding="utf-8")
            assert not (folder / "b").exists() or (folder / "b").read_text(encoding="utf-8") != text
            (partial / "b").write_text(text, encoding="utf-8")
            if cut_off:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write("half", cut_off=True)
    assert list(tmp_path.iterdir()) == []
    write("first")
    (folder / "other").write_text("of the user", encoding="utf-8")
    with pytest.raises(KeyboardInterrupt):
        write("half", cut_off=True)
    write_of = {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()}
    assert write_of == {"a": "first", "b": "first", "other": "of the user"}
    write("second")
    assert {path.name: path.read_text(encoding="utf-8") for path in folder.iterdir()} == {
        "a": "second", "b": "second", "other": "of the user"}


def test_files_in_folders_take_their_places(tmp_path):
    for text in "first", "second":
        with written_together(tmp_path / "package") as partial:
            (partial / "inner" / "deep").mkdir(parents=True)
            (partial / "inner" / "deep" / "file").write_text(text, encoding="utf-8")
        (tmp_path / "package" / "inner" / "other").write_text("of the user", encoding="utf-8")
    assert {str(path.relative_to(tmp_path)): path.read_text(encoding="utf-8")
            for path in tmp_path.rglob("*") if path.is_file()} == {
        "package/inner/deep/file": "second", "package/inner/other": "of the user"}
