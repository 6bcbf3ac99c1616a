"""Convergence, noise removal, changes and refusals of the path tracer; formats of its pictures."""

import sys

import numpy as np
import pytest
from test_scene import CUBE, FACES, floor, scene_of

import warp as wp

image = pytest.importorskip("PIL.Image")


def ball(device):
    scene = scene_of(device, {"sun": (0.4, 0.6, 0.5), "size": 5.0}, size=48)
    floor(scene, color=(0.5, 0.5, 0.5), checker=0.7)
    scene.add_spheres([[0, 0.6, 0]], 0.6, color=(0.8, 0.3, 0.2), roughness=0.4)
    return scene


def test_errors_fall_and_filters_help(device):
    scene = ball(device)
    scene.accumulate(1024)
    exact = scene.radiance()

    def error(samples, denoise):
        scene.clear()
        scene.accumulate(samples, seed=5)
        return float(np.sqrt(np.mean((scene.radiance(denoise) - exact) ** 2)))

    few, many = error(4, False), error(64, False)
    # 16 times the samples: a quarter of the error, or less.
    assert many < 0.32 * few
    assert error(4, True) < 0.75 * few


def test_the_same_seed_gives_the_same_picture(device):
    pictures = []
    for _ in range(2):
        scene = ball(device)
        pictures.append(scene.render(samples=2, seed=3))
    np.testing.assert_array_equal(*pictures)


def test_updates_move_what_is_drawn(device):
    scene = ball(device)
    cube = scene.add_mesh(CUBE * 0.2 + [5, 0, 0], FACES, color=(0.1, 0.9, 0.1))
    balls = scene.spheres[0]
    scene.accumulate(4)
    before = scene.radiance()
    cube.mesh.update(CUBE * 0.2 + [0, 1, 1])
    scene.accumulate(4)
    moved = scene.radiance()
    assert np.abs(moved - before).max() > 0.1
    balls.update([[0, 0.6, -3]])
    scene.accumulate(4)
    assert np.abs(scene.radiance() - moved).max() > 0.1


def test_textures_and_level_sets(device):
    scene = scene_of(device, size=32)
    texture = np.zeros((1, 2, 3), np.float32)
    texture[0, 0], texture[0, 1] = (1, 0, 0), (0, 0, 1)
    uvs = np.array([[0.25, 0.5]] * 8, np.float32)
    scene.add_mesh(CUBE * 0.3, FACES, uvs=uvs, texture=texture, color=(1, 1, 1), specular=0.0)
    axis = np.linspace(-1, 1, 33)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    distance = np.sqrt((x - 0.3) ** 2 + y**2 + (z + 0.2) ** 2) - 0.5
    volume = wp.Volume.load_from_numpy(
        distance.astype(np.float32), (-1, -1, -1), 2.0 / 32.0, bg_value=1.0, device=device
    )
    scene.accumulate(8)
    # One bounce of red from a white sky; deeper ones only redder.
    np.testing.assert_allclose(scene.radiance()[16, 16], [1, 0, 0], atol=1e-4)
    scene.set_camera((0.3, 0.0, 4.0), (0.3, 0.0, -0.2), fov=1.0)
    scene.add_level_set(volume, color=(0, 1, 0), specular=0.0)
    hit = scene_of(device, size=32)
    hit.set_camera((0.3, 0.0, 4.0), (0.3, 0.0, -0.2), fov=1.0)
    hit.add_level_set(volume, color=(0, 1, 0), specular=0.0)
    hit.accumulate(2)
    np.testing.assert_allclose(hit.radiance()[16, 16], [0, 1, 0], atol=1e-4)
    # The surface is where the distance is zero, within a voxel's fiftieth.
    assert float(hit._film.normal.numpy()[16, 16, 3]) / 2 == pytest.approx(3.7, abs=3e-3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: s.add_mesh(CUBE, []), "one or more faces"),
        (lambda s: s.add_mesh(CUBE, [0, 1, 8]), "indices from 0 to 7"),
        (lambda s: s.add_mesh(CUBE * np.nan, FACES), "finite points"),
        (lambda s: s.add_spheres(np.zeros((0, 3)), 1.0), "got none"),
        (lambda s: s.add_spheres([[0, 0, 0]], -1.0), "positive radii"),
        (lambda s: s.add_mesh(CUBE, FACES, transforms=np.zeros((4, 4))), "inverse"),
        (lambda s: s.add_material(color=(-1, 0, 0)), "0 or more"),
        (lambda s: s.add_material(roughness=2.0), "from 0 to 1"),
        (lambda s: s.set_camera((0, 1, 0), (0, 0, 0)), "along"),
        (lambda s: s.radiance(), "samples"),
        (lambda s: s.accumulate(0), "samples"),
        (lambda s: wp.render.Scene(0, 5), "pixels"),
    ],
)
def test_what_cannot_be_drawn_is_refused(call, message):
    with pytest.raises((ValueError, TypeError), match=message):
        call(wp.render.Scene(8, 8, device="cpu"))


@pytest.mark.parametrize("ending", [".jpg", ".gif", ".webp", ".bmp", ".tiff", ".png"])
def test_the_name_gives_the_format(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    pixels = np.zeros((8, 12, 3), np.float32)
    pixels[..., 0] = 1.0
    wp.render.save_picture(path, pixels)
    found = image.open(path)
    names = {"jpg": "JPEG", "tiff": "TIFF"}
    assert found.format == names.get(ending[1:], ending[1:].upper())
    np.testing.assert_allclose(np.asarray(found.convert("RGB"))[4, 4], [255, 0, 0], atol=3)


def test_formats_without_a_writer_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"'\.exr'"):
        wp.render.save_picture(tmp_path / "a.exr", np.zeros((2, 2, 3)))
    with pytest.raises(ValueError, match="without alpha"):
        wp.render.save_picture(tmp_path / "a.jpg", np.zeros((2, 2, 4)))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".gif", ".webp"])
def test_films(tmp_path, ending):
    frames = [np.full((6, 8, 3), level) for level in (0.0, 0.5, 1.0)]
    wp.render.save_movie(tmp_path / f"a{ending}", frames, fps=20)
    found = image.open(tmp_path / f"a{ending}")
    assert found.n_frames == 3
    for number, level in enumerate((0, 128, 255)):
        found.seek(number)
        np.testing.assert_allclose(np.asarray(found.convert("RGB"))[3, 3], level, atol=4)


@pytest.mark.parametrize(
    ("frames", "name", "message"),
    [
        ([], "a.gif", "got none"),
        ([np.zeros((2, 2)), np.zeros((2, 3))], "a.gif", "frame 1"),
        ([np.zeros((2, 2))], "a.avi", r"\.mp4"),
    ],
)
def test_what_is_no_film(tmp_path, frames, name, message):
    with pytest.raises(ValueError, match=message):
        wp.render.save_movie(tmp_path / name, frames)


def test_mp4_needs_a_package_and_says_so(tmp_path, monkeypatch):
    frames = [np.full((16, 16, 3), level / 9) for level in range(10)]
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ImportError, match="pip install imageio-ffmpeg"):
        wp.render.save_movie(tmp_path / "a.mp4", frames)


def test_mp4(tmp_path):
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    frames = [np.full((32, 32, 3), level / 9) for level in range(10)]
    wp.render.save_movie(tmp_path / "a.mp4", frames, fps=10)
    reader = ffmpeg.read_frames(str(tmp_path / "a.mp4"))
    assert next(reader)["size"] == (32, 32)
    found = [np.frombuffer(frame, np.uint8).mean() for frame in reader]
    assert len(found) == 10
    assert found[0] < 10 and found[-1] > 245
