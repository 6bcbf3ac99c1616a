"""Pictures that `wp.render.save_picture` writes, read back with Pillow."""

import numpy as np
import pytest

import warp as wp

image = pytest.importorskip("PIL.Image")


@pytest.mark.parametrize("channels", [None, 1, 2, 3, 4])
def test_bytes_are_kept(tmp_path, channels):
    shape = (5, 7) if channels is None else (5, 7, channels)
    pixels = np.random.default_rng(3).integers(0, 256, shape, np.uint8)
    wp.render.save_picture(tmp_path / "a.png", pixels)
    found = np.asarray(image.open(tmp_path / "a.png"))
    np.testing.assert_array_equal(found.reshape(shape), pixels)


def test_colours_of_kernels(tmp_path, device):
    colours = np.array([[(0.0, 0.5, 1.0), (-1.0, 2.0, np.nan)]], np.float32)
    given = wp.array(colours, dtype=wp.vec3, device=device)
    wp.render.save_picture(str(tmp_path / "a.png"), given)
    found = np.asarray(image.open(tmp_path / "a.png"))
    np.testing.assert_array_equal(found, [[(0, 128, 255), (0, 255, 0)]])


@pytest.mark.parametrize(
    ("pixels", "kind"),
    [
        (np.zeros((2, 2, 5)), ValueError),
        (np.zeros(4), ValueError),
        (np.zeros((0, 3)), ValueError),
        (np.zeros((2, 2), int), TypeError),
    ],
)
def test_what_is_no_picture(tmp_path, pixels, kind):
    with pytest.raises(kind):
        wp.render.save_picture(tmp_path / "a.png", pixels)
    assert not (tmp_path / "a.png").exists()


def test_there_is_no_window():
    with pytest.raises(NotImplementedError, match=r"UsdRenderer"):
        wp.render.OpenGLRenderer()
