import numpy as np
from matplotlib.image import imread

from strapdown_sim.curves import ESTIMATE, span
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


def pixels(path, colour):
    """Number of pixels of a colour, written as #rrggbb."""
    wanted = [int(colour[place:place + 2], 16) for place in (1, 3, 5)]
    return int((np.rint(255 * imread(path)[..., :3]) == wanted).all(axis=-1).sum())


def test_few_points_are_marked(tmp_path):
    """A single sample of a third estimate, and the samples of a short run, which shows the first and the last whole."""
    device = np.full((len(TIME), 3), np.nan)
    device[250] = 0
    # A mark has a diameter of 4/72 inches, 8.3 pixels at 150 dpi, and so 31 whole ones; there are three, and one in the
    # legend.
    alone = pixels(draw(tmp_path / "a.png", device=device), ESTIMATE)
    assert alone >= 4 * 31
    short = {"time_s": TIME[:2], "hardware": ANGLES[:2], "reference_model": ANGLES[:2] + 90, "rotation": np.ones(2)}
    at_ends = pixels(draw(tmp_path / "b.png", **short, device=ANGLES[:2] + 45), ESTIMATE)
    assert at_ends > 1.5 * alone
    assert span(TIME[:2])[0] < TIME[0] < TIME[1] < span(TIME[:2])[1]
    assert span(TIME) == (TIME[0], TIME[-1])
