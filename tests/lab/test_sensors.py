"""The generated parts of docs/sensors.md agree with the code; `make docs` writes them."""

from strapdown_lab.checkout import replaced
from strapdown_lab.report.sensors import sensor_blocks


def test_document_is_up_to_date(root):
    page = (root / "docs" / "sensors.md").read_text(encoding="utf-8")
    assert replaced(page, sensor_blocks()) == page
