"""`wp.render.Viewer`, whose server is asked for its page, and what it says without viser."""

import sys
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


def test_absence_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ImportError, match="pip install viser"):
        wp.render.Viewer(scene())


def test_other_backends_are_refused():
    with pytest.raises(ValueError, match=r"'opengl'.*save_html"):
        wp.render.Viewer(scene(), backend="opengl")
