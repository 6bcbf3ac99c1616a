"""`wp.render.Viewer`, whose server is asked for its page, and what it says without viser."""

import contextlib
import sys
import types
import urllib.request

import numpy as np
import pytest
from test_scene import CUBE, FACES

import warp as wp


def scene():
    made = wp.render.Scene(32, 32, device="cpu")
    made.add_mesh(CUBE, FACES, transforms=[np.eye(4), np.diag([2.0, 2.0, 2.0, 1.0])])
    made.add_spheres(np.zeros((3, 3)), [0.1, 0.2, 0.3])
    made.add_spheres(np.zeros((20_001, 3)), 0.1)
    return made


def test_the_viewer_serves_and_follows():
    pytest.importorskip("viser")
    viewer = wp.render.Viewer(scene(), port=18_734)
    try:
        viewer.scene.spheres[0].update(np.ones((3, 3)))
        viewer.update()
        address = f"http://localhost:{viewer.server.get_port()}"
        assert b"<html" in urllib.request.urlopen(address, timeout=20).read().lower()
    finally:
        viewer.close()


class Recorder:
    """A server that keeps what a viewer shows."""

    def __init__(self, **options):
        self.scene, self.shown = self, {}
        self.initial_camera = types.SimpleNamespace()

    def ignore(self, *given, **options):
        pass

    set_up_direction = configure_default_lights = configure_environment_map = ignore
    add_light_directional = add_light_ambient = ignore

    def atomic(self):
        return contextlib.nullcontext()

    def add_mesh_simple(self, name, points, faces, **options):
        self.shown[name] = points, faces


def test_scenes_too_large_are_refused_or_made_coarser(monkeypatch):
    """10^7 triangles of a surface that is known."""
    monkeypatch.setitem(sys.modules, "viser", types.SimpleNamespace(ViserServer=Recorder))
    x, made = np.linspace(-1.0, 1.0, 2237), wp.render.Scene(64, 64, device="cpu")
    made.add_height_field(0.2 * np.sin(3.0 * x)[:, None] * np.cos(2.0 * x), (-1, -1), (1, 1))
    with pytest.raises(ValueError, match=r"9,999,392 triangles .* decimate=True"):
        wp.render.Viewer(made)
    made.set_camera((1.0, 2.0, 3.0), (0.0, 0.5, 0.0), fov=60.0)
    viewer = wp.render.Viewer(made, max_triangles=50_000, decimate=True)
    camera = viewer.server.initial_camera
    assert camera.position == (1.0, 2.0, 3.0) and camera.look_at == (0.0, 0.5, 0.0)
    assert camera.fov == pytest.approx(np.pi / 3.0)
    ((points, faces),) = viewer.server.shown.values()
    assert 20_000 < len(faces) <= 50_000 and faces.max() < len(points)
    x, y, z = points.astype(float).T
    assert np.abs(0.2 * np.sin(3.0 * x) * np.cos(2.0 * z) - y).max() < 1e-6


def test_absence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ImportError, match="pip install viser"):
        wp.render.Viewer(scene())


def test_other_backends_are_refused():
    with pytest.raises(ValueError, match=r"'opengl'.*save_html"):
        wp.render.Viewer(scene(), backend="opengl")
