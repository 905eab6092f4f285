"""Generated parts and drawings of docs/sensors.md and docs/optical.md agree with the code; `make docs` writes them."""

from strapdown_lab.checkout import replaced
from strapdown_lab.report.optical_diagram import draw_optical
from strapdown_lab.report.sensors import sensor_blocks, write_waves


def test_document_is_up_to_date(root):
    page = (root / "docs" / "sensors.md").read_text(encoding="utf-8")
    assert replaced(page, sensor_blocks()) == page


def test_diagrams_are_up_to_date(root, tmp_path):
    kept = {path.name: path.read_bytes() for path in (root / "docs" / "sensors").iterdir()}
    assert {path.name: path.read_bytes() for path in write_waves(tmp_path / "sensors")} == kept


def test_block_diagram_is_up_to_date(root, tmp_path):
    draw_optical(tmp_path / "optical.svg")
    assert (tmp_path / "optical.svg").read_bytes() == (root / "docs" / "optical.svg").read_bytes()
