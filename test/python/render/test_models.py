"""Meshes and scenes written for other programs and read again."""

import sys

import numpy as np
import pytest
from test_scene import CUBE, FACES

import warp as wp


def sorted_corners(points, indices):
    """The triangles' corners, whatever vertices are called."""
    rows = np.round(np.asarray(points)[np.asarray(indices).reshape(-1)], 4).reshape(-1, 9)
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize("ending", ["obj", "stl", "ply", "glb", "gltf"])
def test_meshes_come_back(tmp_path, ending):
    pytest.importorskip("trimesh")
    path = tmp_path / f"a.{ending}"
    wp.render.save_mesh(path, wp.array(CUBE, dtype=wp.vec3, device="cpu"), FACES)
    found = wp.render.load_mesh(path)
    assert found.indices.dtype == np.int32 and found.points.dtype == np.float32
    np.testing.assert_array_equal(
        sorted_corners(found.points, found.indices), sorted_corners(CUBE, FACES)
    )


def test_colours_and_texture_coordinates(tmp_path):
    pytest.importorskip("trimesh")
    colors = (CUBE + 1.0) / 2.0
    wp.render.save_mesh(tmp_path / "a.ply", CUBE, FACES, colors=colors)
    np.testing.assert_allclose(wp.render.load_mesh(tmp_path / "a.ply").colors, colors, atol=1 / 255)
    uvs = colors[:, :2]
    wp.render.save_mesh(tmp_path / "a.glb", CUBE, FACES, uvs=uvs)
    np.testing.assert_allclose(wp.render.load_mesh(tmp_path / "a.glb").uvs, uvs, atol=1e-6)


@pytest.mark.parametrize("contents", [b"", b"glTF\0\0garbage", b"solid x\nendsolid x\n"])
def test_files_without_a_mesh_are_refused(tmp_path, contents):
    pytest.importorskip("trimesh")
    for name in ("a.glb", "a.stl", "a.obj", "a.ply"):
        (tmp_path / name).write_bytes(contents)
        with pytest.raises(ValueError, match=r"a\.\w+'"):
            wp.render.load_mesh(tmp_path / name)
    with pytest.raises(FileNotFoundError):
        wp.render.load_mesh(tmp_path / "b.obj")


def test_wrong_meshes_and_absent_packages(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match=r"'\.fbx'"):
        wp.render.save_mesh(tmp_path / "a.fbx", CUBE, FACES)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ImportError, match="pip install trimesh"):
        wp.render.save_mesh(tmp_path / "a.obj", CUBE, FACES)


def scene():
    made = wp.render.Scene(16, 16, device="cpu")
    where = np.eye(4)
    where[:3, 3] = (1, 2, 3)
    red = {"color": (0.9, 0.1, 0.1), "metallic": 1.0, "roughness": 0.25}
    made.add_mesh(CUBE, FACES, transforms=[np.eye(4), where], **red)
    made.add_spheres([[5, 0, 0], [7, 0, 0]], [0.5, 0.25], emission=(4.0, 2.0, 1.0))
    made.set_sky(sun=(0.0, 1.0, 0.0))
    return made


def test_scenes_as_gltf(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    scene().save_model(tmp_path / "a.glb")
    found = trimesh.load(tmp_path / "a.glb")
    assert len(found.graph.nodes_geometry) == 4
    np.testing.assert_allclose(found.bounds, [[-1, -1, -1], [7.25, 3, 4]], atol=1e-3)
    look = found.geometry["mesh0"].visual.material
    assert look.metallicFactor == 1.0 and look.roughnessFactor == 0.25


def test_scenes_as_usd_have_lights_and_materials(tmp_path):
    usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom, UsdLux, UsdShade

    scene().save_model(tmp_path / "a.usda")
    stage = usd.Stage.Open(str(tmp_path / "a.usda"))
    kinds = [prim.GetTypeName() for prim in stage.Traverse()]
    assert kinds.count("Mesh") == 2 and kinds.count("Points") == 1
    assert {"DomeLight", "DistantLight", "SphereLight"} <= set(kinds)
    second = stage.GetPrimAtPath("/root/mesh0_1")
    matrix = UsdGeom.Xformable(second).ComputeLocalToWorldTransform(0)
    assert tuple(matrix.ExtractTranslation()) == (1, 2, 3)
    material, _ = UsdShade.MaterialBindingAPI(second).ComputeBoundMaterial()
    shader = material.ComputeSurfaceSource()[0]
    assert shader.GetInput("metallic").Get() == 1.0
    np.testing.assert_allclose(shader.GetInput("diffuseColor").Get(), (0.9, 0.1, 0.1))
    # Light of the sun falls down.
    sun = UsdGeom.Xformable(UsdLux.DistantLight.Get(stage, "/root/sun"))
    along = sun.ComputeLocalToWorldTransform(0).TransformDir((0, 0, -1))
    np.testing.assert_allclose(along, (0, -1, 0), atol=1e-6)


def test_empty_scenes_are_refused(tmp_path):
    with pytest.raises(ValueError, match="meshes or spheres"):
        wp.render.Scene(8, 8, device="cpu").save_model(tmp_path / "a.glb")
