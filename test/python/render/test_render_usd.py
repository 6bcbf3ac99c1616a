"""USD stages that `wp.render.UsdRenderer` writes, read back with USD."""

import sys

import numpy as np
import pytest

import warp as wp

NO_TURN = (0.0, 0.0, 0.0, 1.0)


@pytest.fixture
def usd():
    return pytest.importorskip("pxr.Usd", reason="no usd-core")


@pytest.fixture
def written(usd, tmp_path):
    """Draws with a function and opens the stage from the file."""

    def run(draw, **options):
        path = tmp_path / "scene.usda"
        renderer = wp.render.UsdRenderer(str(path), **options)
        draw(renderer)
        renderer.save()
        return usd.Stage.Open(str(path))

    return run


def world(stage, path, time=0.0):
    """The matrix of a prim, for points as columns."""
    from pxr import UsdGeom

    found = UsdGeom.Xformable(stage.GetPrimAtPath(path)).ComputeLocalToWorldTransform(time)
    return np.array(found).T


def value(stage, path, name, time=0.0):
    return stage.GetPrimAtPath(path).GetAttribute(name).Get(time)


def test_points_of_each_frame(written, device):
    frames = np.random.default_rng(1).random((3, 5, 3)).astype(np.float32)

    def draw(renderer):
        for i, frame in enumerate(frames):
            renderer.begin_frame(i / 24)
            given = wp.array(frame, dtype=wp.vec3, device=device)
            path = renderer.render_points("my points", given, 0.25, colors=[(1, 0, 0)] * 5)
            renderer.end_frame()
            assert path == "/root/my_points"

    stage = written(draw, fps=24)
    assert (stage.GetEndTimeCode(), stage.GetFramesPerSecond()) == (2, 24)
    for i, frame in enumerate(frames):
        np.testing.assert_array_equal(value(stage, "/root/my_points", "points", i), frame)
    assert list(value(stage, "/root/my_points", "widths")) == [0.5]
    assert len(value(stage, "/root/my_points", "primvars:displayColor")) == 5


def test_a_mesh_keeps_its_triangles(written):
    points = np.eye(3, dtype=np.float32)
    triangles = wp.array([0, 1, 2, 0, 2, 1], dtype=int, device="cpu")

    def draw(renderer):
        for i in range(2):
            renderer.begin_frame(i / 60)
            renderer.render_mesh("body", points * (i + 1), triangles, scale=(1, 2, 3))

    stage = written(draw)
    assert list(value(stage, "/root/body", "faceVertexIndices", 1)) == [0, 1, 2, 0, 2, 1]
    assert list(value(stage, "/root/body", "faceVertexCounts")) == [3, 3]
    np.testing.assert_array_equal(value(stage, "/root/body", "points", 1), 2 * points)
    np.testing.assert_allclose(world(stage, "/root/body")[:3, :3], np.diag([1, 2, 3]))


def test_poses_bodies_and_scaling(written):
    half = np.sqrt(0.5)
    turn = (0.0, 0.0, half, half)  # by 90 degrees about z

    def draw(renderer):
        renderer.render_box("box", (1, 2, 3), turn, (0.5, 1, 2), parent_body="arm", visible=False)
        renderer.render_capsule("pill", (0, 0, 0), NO_TURN, 0.5, 2.0, up_axis=0, color=(0, 1, 0))
        renderer.render_sphere("ball", (0, 4, 0), NO_TURN, 3.0)

    stage = written(draw, scaling=10.0, up_axis="z")
    box = world(stage, "/root/arm/box")
    turned = [[0, -1, 0], [1, 0, 0], [0, 0, 1]] @ np.diag([0.5, 1, 2])
    np.testing.assert_allclose(box[:3, :3], 10 * turned, atol=1e-5)
    np.testing.assert_allclose(box[:3, 3], [10, 20, 30])
    assert value(stage, "/root/arm/box", "visibility") == "invisible"
    pill = "/root/pill"
    assert [value(stage, pill, name) for name in ("radius", "height", "axis")] == [0.5, 4.0, "X"]
    assert value(stage, "/root/ball", "radius") == 3.0


def test_templates_are_drawn_where_they_are_placed(written):
    def draw(renderer):
        shape = renderer.render_cone("cone", (0, 0, 0), NO_TURN, 1.0, 2.0, is_template=True)
        renderer.register_body("b")
        renderer.add_shape_instance("one", shape, "b", (5, 0, 0), NO_TURN, color1=(1, 1, 0))

    stage = written(draw)
    prim = stage.GetPrimAtPath("/root/b/one")
    assert prim.GetTypeName() == "Cone"
    np.testing.assert_allclose(world(stage, "/root/b/one")[:3, 3], [5, 0, 0])
    assert stage.GetPrimAtPath("/_templates").IsAbstract()


@pytest.mark.parametrize("plane", [None, (1.0, 2.0, -2.0, 6.0)])
def test_the_ground_lies_in_its_plane(written, plane):
    stage = written(lambda renderer: renderer.render_ground(3.0, plane))
    corners = np.array(value(stage, "/root/ground", "points"))
    a, b, c, d = plane or (0, 1, 0, 0)
    np.testing.assert_allclose(corners @ [a, b, c] + d, 0, atol=1e-5)
    edges = np.linalg.norm(np.roll(corners, 1, 0) - corners, axis=1)
    np.testing.assert_allclose(edges, 6.0, rtol=1e-6)


def test_lines_arrows_and_planes(written):
    points = np.arange(12, dtype=np.float32).reshape(4, 3)

    def draw(renderer):
        renderer.render_line_list("pairs", points, [0, 3, 1, 2], radius=0.5)
        renderer.render_line_strip("strip", points, color=(1, 0, 0))
        renderer.render_arrow("arrow", (0, 0, 0), NO_TURN, 0.1, 1.0, up_axis=2)
        renderer.render_plane("plane", (0, 0, 0), NO_TURN, 4.0, 2.0)

    stage = written(draw)
    np.testing.assert_array_equal(value(stage, "/root/pairs", "points"), points[[0, 3, 1, 2]])
    assert list(value(stage, "/root/pairs", "curveVertexCounts")) == [2, 2]
    assert list(value(stage, "/root/strip", "curveVertexCounts")) == [4]
    np.testing.assert_allclose(world(stage, "/root/arrow/base")[:3, 3], [0, 0, 0.5])
    corners = np.array(value(stage, "/root/plane", "points"))
    np.testing.assert_array_equal(np.ptp(corners, axis=0), [4, 0, 2])


def test_bad_input(usd, tmp_path):
    with pytest.raises(ValueError, match="up_axis"):
        wp.render.UsdRenderer(str(tmp_path / "a.usda"), up_axis="W")
    renderer = wp.render.UsdRenderer(str(tmp_path / "b.usda"))
    points = np.zeros((4, 3))
    for indices in ([0, 1], [0, 1, 4], [-1, 0, 1]):
        with pytest.raises(ValueError, match="of the 4 points|three indices"):
            renderer.render_mesh("m", points, indices)
    with pytest.raises(ValueError, match=r"shape \(n, 3\)"):
        renderer.render_points("p", np.zeros((4, 2)), 1.0)
    with pytest.raises(ValueError, match="one radius or 4"):
        renderer.render_points("p", points, [1.0, 2.0])
    with pytest.raises(ValueError, match="normal"):
        renderer.render_ground(plane=(0, 0, 0, 1))
    renderer.render_points("p", np.zeros((0, 3)), 1.0)
    renderer.save()


def test_without_usd(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(ImportError, match="pip install usd-core"):
        wp.render.UsdRenderer(str(tmp_path / "scene.usda"))
