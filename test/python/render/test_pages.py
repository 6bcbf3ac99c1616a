"""Pages that `Scene.save_html` writes, in headless Chromium where there is one."""

import base64
import io
import json
import re

import numpy as np
import pytest
from test_scene import CUBE, FACES

import warp as wp


def moving_scene(frames=8):
    scene = wp.render.Scene(64, 64, device="cpu")
    scene.set_camera((0.0, 1.0, 6.0), (0.0, 0.0, 0.0))
    cube = scene.add_mesh(CUBE * 0.5, FACES, smooth=False, color=(0.9, 0.1, 0.1))
    balls = scene.add_spheres([[1.5, 0, 0], [-1.5, 0, 0]], 0.4, color=(0.1, 0.2, 0.9))
    for number in range(frames):
        where = np.eye(4)
        where[1, 3] = 0.2 * number
        cube.update(where)
        cube.mesh.update(CUBE * (0.5 + 0.02 * number))
        balls.update([[1.5, -0.1 * number, 0], [-1.5, 0.1 * number, 0]])
        scene.keep_frame()
    return scene


def contents(path):
    """The record of a page and its arrays."""
    text = path.read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S).group(1))
    blob = base64.b64decode(re.search(r'id="blob">(.*?)</script>', text, re.S).group(1))
    return text, data, lambda at: np.frombuffer(blob, at[2], at[1], at[0])


def test_a_page_is_alone_and_has_the_positions(tmp_path):
    scene = moving_scene()
    scene.save_html(tmp_path / "a.html", title="Cube <1>")
    text, data, read = contents(tmp_path / "a.html")
    assert not re.search(r"(src|href)\s*=|https?://|import\s*\(", text)
    assert "<title>Cube &lt;1></title>" in text
    assert data["count"] == 8
    points = data["meshes"][0]["points"]
    for number in (0, 7):
        steps = read(points["frames"][number]).reshape(-1, 3)
        found = np.array(points["low"]) + steps * np.array(points["step"])
        np.testing.assert_allclose(found, CUBE * (0.5 + 0.02 * number), atol=1.4 / 65535)
    rows = read(data["spheres"][0]["centers"]["frames"][7]).reshape(-1, 3)
    found = np.array(data["spheres"][0]["centers"]["low"])
    found = found + rows * np.array(data["spheres"][0]["centers"]["step"])
    np.testing.assert_allclose(found, [[1.5, -0.7, 0], [-1.5, 0.7, 0]], atol=1e-4)


def test_what_stands_still_is_stored_once(tmp_path):
    scene = moving_scene()
    scene.frames = scene.frames[:1] * 8
    scene.save_html(tmp_path / "a.html")
    _, data, _ = contents(tmp_path / "a.html")
    assert len({tuple(at[:2]) for at in data["meshes"][0]["points"]["frames"]}) == 1


def grid(n):
    scene = wp.render.Scene(64, 64, device="cpu")
    x = np.linspace(-1.0, 1.0, n)
    scene.add_height_field(0.2 * np.sin(3.0 * x)[:, None] * np.cos(2.0 * x), (-1, -1), (1, 1))
    return scene


def test_scenes_too_large_are_refused_or_made_coarser(tmp_path):
    # 10^7 triangles.
    scene = grid(2237)
    with pytest.raises(ValueError, match=r"9,999,392 triangles .* decimate=True"):
        scene.save_html(tmp_path / "a.html")
    assert not (tmp_path / "a.html").exists()
    scene.save_html(tmp_path / "a.html", max_triangles=50_000, decimate=True)
    _, data, read = contents(tmp_path / "a.html")
    faces = read(data["meshes"][0]["indices"])
    assert 20_000 < len(faces) // 3 <= 50_000
    points = data["meshes"][0]["points"]
    found = np.array(points["low"]) + read(points["frames"][0]).reshape(-1, 3) * points["step"]
    x, y, z = found.T
    # Vertices that are kept lie on the surface.
    assert np.abs(0.2 * np.sin(3.0 * x) * np.cos(2.0 * z) - y).max() < 1e-3


def test_parts_added_between_frames_are_refused(tmp_path):
    scene = moving_scene()
    scene.add_spheres([[0, 0, 0]], 1.0)
    with pytest.raises(ValueError, match="added"):
        scene.save_html(tmp_path / "a.html")


def pixels(page):
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_draws_plays_scrubs_and_turns(tmp_path, browser, scheme):
    moving_scene().save_html(tmp_path / "a.html", fps=20)
    page = browser.new_page(viewport={"width": 480, "height": 320}, color_scheme=scheme)
    problems = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
    page.goto((tmp_path / "a.html").as_uri())
    page.wait_for_function("window.warpScene !== undefined && warpScene.frame > 1")
    assert page.evaluate("warpScene.playing")
    assert page.evaluate("[warpScene.triangles, warpScene.spheres, warpScene.error()]") == [
        12,
        2,
        0,
    ]
    page.click("#play")
    assert not page.evaluate("warpScene.playing")

    def scrub(number):
        page.evaluate(
            "n => { const s = document.getElementById('scrub'); s.value = n;"
            " s.dispatchEvent(new Event('input')); }",
            number,
        )
        page.wait_for_timeout(300)
        return pixels(page)

    first, last = scrub(0), scrub(7)
    assert page.evaluate("warpScene.frame") == 7
    red, blue = (first[..., 0] - first[..., k] > 40 for k in (2, 0))
    blue = first[..., 2] - first[..., 0] > 40
    assert red.sum() > 1000 and blue.sum() > 1000
    # The cube rises from the middle of the window.
    rise = [np.nonzero(each[..., 0] - each[..., 2] > 40)[0].mean() for each in (first, last)]
    assert rise[0] - rise[1] > 40
    page.mouse.move(240, 100)
    page.mouse.down()
    page.mouse.move(340, 60, steps=4)
    page.mouse.up()
    page.wait_for_timeout(300)
    assert (np.abs(pixels(page) - last).sum(-1) > 30).mean() > 0.02
    assert problems == []
    page.close()


@pytest.mark.parametrize("frames", [1, 2])
def test_only_films_have_a_bar(tmp_path, browser, frames):
    moving_scene(frames).save_html(tmp_path / "a.html")
    page = browser.new_page(viewport={"width": 320, "height": 240})
    page.goto((tmp_path / "a.html").as_uri())
    page.wait_for_function("window.warpScene !== undefined")
    assert page.is_visible("#bar") == (frames > 1)
