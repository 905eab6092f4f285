import numpy as np
from matplotlib.image import imread

from strapdown_sim.picture import attitude_picture

TIME = np.arange(500) / 100
ANGLES = np.stack([30 * np.sin(TIME), 20 * np.cos(TIME), (100 * TIME) % 360], axis=-1)


def draw(path, **changes):
    attitude_picture(path, **{"title": "turn", "time_s": TIME, "hardware": ANGLES, "reference_model": ANGLES + 1e-4,
                              "rotation": np.full(len(TIME), 2e-4)}
                     | changes)
    return path


def test_picture_is_an_image_with_something_on_it(tmp_path):
    image = imread(draw(tmp_path / "a.png", device=ANGLES + 5))
    assert image.shape[0] > 800
    assert image[..., :3].min() < 0.5
    assert (image[..., :3].mean(axis=(1, 2)) < 1).mean() > 0.5


def test_equal_data_give_equal_bytes(tmp_path):
    assert draw(tmp_path / "a.png").read_bytes() == draw(tmp_path / "b.png").read_bytes()


def test_other_data_give_another_picture(tmp_path):
    assert draw(tmp_path / "a.png").read_bytes() != draw(tmp_path / "b.png", hardware=-ANGLES).read_bytes()


def test_exact_agreement_can_be_drawn(tmp_path):
    assert draw(tmp_path / "a.png", reference_model=ANGLES).exists()


def test_the_rotation_angle_is_drawn(tmp_path):
    """The figure in the tables has a separate line, because Euler angles differ from it near the pole."""
    assert draw(tmp_path / "a.png").read_bytes() != draw(tmp_path / "b.png", rotation=np.ones(len(TIME))).read_bytes()
