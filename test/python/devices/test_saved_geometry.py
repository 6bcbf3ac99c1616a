"""Graphs in files that search meshes, hierarchies, hash grids, volumes and textures."""

import gc
import os
import subprocess
import sys

import numpy as np
import pytest

import warp as wp


@wp.struct
class Scene:
    scale: float
    mesh: wp.uint64


@wp.struct
class Row:
    weight: float
    id: wp.uint64


@wp.kernel
def distances(mesh: wp.uint64, queries: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, queries[i], 1.0e3)
    at = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
    out[i] = wp.length(at - queries[i])


@wp.kernel
def scene_distances(scene: Scene, queries: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(scene.mesh, queries[i], 1.0e3)
    at = wp.mesh_eval_position(scene.mesh, found.face, found.u, found.v)
    out[i] = scene.scale * wp.length(at - queries[i])


@wp.kernel
def distances_by_id(
    ids: wp.array(dtype=wp.uint64),
    rows: wp.array(dtype=Row),
    queries: wp.array(dtype=wp.vec3),
    out: wp.array2d(dtype=float),
):
    i, k = wp.tid()
    id = ids[k]
    if k == 2:
        id = rows[1].id
    found = wp.mesh_query_point_no_sign(id, queries[i], 1.0e3)
    at = wp.mesh_eval_position(id, found.face, found.u, found.v)
    out[i, k] = wp.length(at - queries[i])


@wp.kernel
def insides(mesh: wp.uint64, queries: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    i = wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, queries[i], 1.0e3)
    out[i] = found.sign


@wp.kernel
def neighbours(
    grid: wp.uint64, points: wp.array(dtype=wp.vec3), radius: float, out: wp.array(dtype=int)
):
    i = wp.tid()
    count = int(0)
    for j in wp.hash_grid_query(grid, points[i], radius):
        if wp.length(points[j] - points[i]) < radius:
            count += 1
    out[i] = count


@wp.kernel
def overlaps(bvh: wp.uint64, root: int, out: wp.array(dtype=int)):
    i = wp.tid()
    x = float(i)
    count = int(0)
    for _ in wp.bvh_query_aabb(bvh, wp.vec3(x, 0.0, 0.0), wp.vec3(x + 1.5, 1.0, 1.0), root):
        count += 1
    out[i] = count


@wp.kernel
def samples(volume: wp.uint64, texture: wp.Texture2D, out: wp.array(dtype=float)):
    i = wp.tid()
    p = wp.vec3(0.25 * float(i), 1.0, 2.0)
    u = wp.vec2(0.125 * float(i), 0.5)
    out[i] = wp.volume_sample_f(volume, p, wp.Volume.LINEAR) + 10.0 * wp.texture_sample(
        texture, u, dtype=float
    )


@wp.kernel
def move(points: wp.array(dtype=wp.vec3), offset: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    points[i] = points[i] + offset[0]


CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float32)
FACES = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1]
FACES += [2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]
RNG = np.random.default_rng(7)
QUERIES = (RNG.random((50, 3)) * 6 - 2).astype(np.float32)


def cube(device, offset=0.0, **options):
    points = wp.array(CUBE + np.float32(offset), dtype=wp.vec3, device=device)
    return wp.Mesh(points, wp.array(FACES, dtype=int, device=device), **options)


def to_cube(offset=0.0):
    """Exact distances of the queries from the surface of a cube."""
    q = QUERIES.astype(np.float64) - offset
    outside = np.linalg.norm(np.maximum(np.maximum(-q, q - 1), 0), axis=1)
    inside = np.minimum(q, 1 - q).min(axis=1)
    return np.where(outside > 0, outside, np.maximum(inside, 0))


def reloaded(tmp_path, device, capture, inputs=None, outputs=None):
    path = str(tmp_path / "graph")
    wp.capture_save(capture.graph, path, inputs=inputs, outputs=outputs)
    return wp.capture_load(path, device=device)


def result(graph, name, like):
    out = wp.empty_like(like)
    graph.get_param(name, out)
    return out.numpy()


def is_close(a, b):
    return np.allclose(a, b, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("constructor", [None, "sah", "lbvh"])
def test_a_mesh_is_in_the_file(device, tmp_path, constructor):
    queries = wp.array(QUERIES, dtype=wp.vec3, device=device)
    mesh = cube(device, bvh_constructor=constructor, support_winding_number=True)
    scene = Scene()
    scene.scale, scene.mesh = 2.0, mesh.id
    out, twice, signs = (wp.zeros(50, device=device) for _ in range(3))
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(distances, 50, [mesh.id, queries, out], device=device)
        wp.launch(scene_distances, 50, [scene, queries, twice], device=device)
        wp.launch(insides, 50, [mesh.id, queries, signs], device=device)
    named = {"out": out, "twice": twice, "signs": signs}
    graph = reloaded(tmp_path, device, capture, {"queries": queries}, named)
    del mesh, scene
    gc.collect()
    wp.capture_launch(graph)
    assert is_close(result(graph, "out", out), to_cube())
    assert is_close(result(graph, "twice", twice), 2 * to_cube())
    inside = ((QUERIES > 0) & (QUERIES < 1)).all(axis=1)
    assert (result(graph, "signs", signs) == np.where(inside, -1, 1)).all()


def test_ids_in_arrays(device, tmp_path):
    queries = wp.array(QUERIES, dtype=wp.vec3, device=device)
    meshes = [cube(device, offset) for offset in (0.0, 1.0, 2.0)]
    ids = wp.array([meshes[0].id, meshes[1].id, 0], dtype=wp.uint64, device=device)
    row = Row()
    row.weight, row.id = 1.0, meshes[2].id
    rows = wp.array([Row(), row], dtype=Row, device=device)
    out = wp.zeros((50, 3), device=device)
    swapped = np.array([meshes[1].id, meshes[0].id, 5], np.uint64)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(distances_by_id, (50, 3), [ids, rows, queries, out], device=device)
        wp.copy(ids, wp.array(swapped, dtype=wp.uint64, device="cpu"))
    graph = reloaded(tmp_path, device, capture, outputs={"out": out, "ids": ids})
    del meshes
    gc.collect()
    expected = np.stack([to_cube(offset) for offset in (0.0, 1.0, 2.0)], axis=1)
    wp.capture_launch(graph)
    assert is_close(result(graph, "out", out), expected)
    wp.capture_launch(graph)
    assert is_close(result(graph, "out", out), expected[:, [1, 0, 2]])
    # Numbers that are no ids stay what they are.
    assert result(graph, "ids", ids)[2] == 5


@pytest.mark.parametrize("constructor", [None, "sah"])
@pytest.mark.parametrize("rebuilds", [False, True])
def test_a_mesh_moves_in_the_graph(device, tmp_path, constructor, rebuilds):
    if rebuilds and constructor == "sah" and wp.get_device(device).is_cuda:
        pytest.skip("the host builds, which no CUDA graph captures")
    queries = wp.array(QUERIES, dtype=wp.vec3, device=device)
    mesh = cube(device, bvh_constructor=constructor)
    (mesh.rebuild if rebuilds else mesh.refit)()
    offset = wp.zeros(1, dtype=wp.vec3, device=device)
    out = wp.zeros(50, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(move, 8, [mesh.points, offset], device=device)
        (mesh.rebuild if rebuilds else mesh.refit)()
        wp.launch(distances, 50, [mesh.id, queries, out], device=device)
    graph = reloaded(tmp_path, device, capture, {"offset": offset}, {"out": out})
    one = wp.array([[1.0, 1.0, 1.0]], dtype=wp.vec3, device=device)
    # The graph itself, and what was loaded, which has a mesh of its own.
    wp.capture_launch(capture.graph)
    assert is_close(out.numpy(), to_cube())
    wp.copy(offset, one)
    wp.capture_launch(capture.graph)
    assert is_close(out.numpy(), to_cube(1.0))
    del mesh
    gc.collect()
    for step in range(3):
        graph.set_param("offset", wp.zeros_like(one) if step == 1 else one)
        wp.capture_launch(graph)
        assert is_close(result(graph, "out", out), to_cube([1.0, 1.0, 2.0][step])), step


def brute_force(points, radius):
    away = points[:, None].astype(np.float64) - points[None]
    return (np.linalg.norm(away, axis=2) < radius).sum(axis=1)


@pytest.mark.parametrize("builds", [False, True])
def test_hash_grids(device, tmp_path, builds):
    positions = RNG.random((300, 3)).astype(np.float32)
    points = wp.array(positions, dtype=wp.vec3, device=device)
    grid, radius = wp.HashGrid(8, 8, 8, device=device), 0.15
    grid.build(points, radius)
    out = wp.zeros(300, dtype=int, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        if builds:
            grid.build(points, radius)
        wp.launch(neighbours, 300, [grid.id, points, radius, out], device=device)
    graph = reloaded(tmp_path, device, capture, {"points": points}, {"out": out})
    others = RNG.random((300, 3)).astype(np.float32)
    if builds:
        # The captured graph builds whenever it runs.
        points.assign(others)
        wp.capture_launch(capture.graph)
        assert (out.numpy() == brute_force(others, radius)).all()
    del grid
    gc.collect()
    wp.capture_launch(graph)
    assert (result(graph, "out", out) == brute_force(positions, radius)).all()
    if builds:
        graph.set_param("points", wp.array(others, dtype=wp.vec3, device=device))
        wp.capture_launch(graph)
        assert (result(graph, "out", out) == brute_force(others, radius)).all()


@pytest.mark.parametrize("kind", ["still", "refit", "rebuild", "groups"])
def test_hierarchies(device, tmp_path, kind):
    low = np.array([[i, 0, 0] for i in range(20)], np.float32) + 0.1
    lowers = wp.array(low, dtype=wp.vec3, device=device)
    uppers = wp.array(low + np.float32(0.8), dtype=wp.vec3, device=device)
    groups = None
    if kind == "groups":
        groups = wp.array(np.arange(20) % 2, dtype=int, device=device)
    bvh = wp.Bvh(lowers, uppers, groups=groups)
    out = wp.zeros(20, dtype=int, device=device)
    root = -1
    if kind == "groups":
        root = root_of(bvh, 1, device)
    if kind == "refit":
        bvh.refit()
    with wp.ScopedCapture(device, apic=True) as capture:
        if kind in ("refit", "groups"):
            bvh.refit()
        elif kind == "rebuild":
            bvh.rebuild()
        wp.launch(overlaps, 20, [bvh.id, root, out], device=device)
    named = {"lowers": lowers, "uppers": uppers}
    graph = reloaded(tmp_path, device, capture, named, {"out": out})
    del bvh
    gc.collect()

    def expected(low):
        x = np.arange(20)[:, None]
        hit = (low[None, :, 0] <= x + 1.5) & (low[None, :, 0] + 0.8 >= x)
        if kind == "groups":
            hit &= (np.arange(20) % 2 == 1)[None]
        return hit.sum(axis=1)

    wp.capture_launch(graph)
    assert (result(graph, "out", out) == expected(low)).all()
    moved = low[::-1].copy() * np.float32(0.5)
    graph.set_param("lowers", wp.array(moved, dtype=wp.vec3, device=device))
    graph.set_param("uppers", wp.array(moved + np.float32(0.8), dtype=wp.vec3, device=device))
    wp.capture_launch(graph)
    after = low if kind == "still" else moved
    assert (result(graph, "out", out) == expected(after)).all()


@wp.kernel
def find_root(bvh: wp.uint64, group: int, out: wp.array(dtype=int)):
    out[0] = wp.bvh_get_group_root(bvh, group)


def root_of(bvh, group, device):
    out = wp.zeros(1, dtype=int, device=device)
    wp.launch(find_root, 1, [bvh.id, group, out], device=device)
    return int(out.numpy()[0])


def test_volumes_and_textures(device, tmp_path):
    values = RNG.random((6, 6, 6)).astype(np.float32)
    volume = wp.Volume.load_from_numpy(values, device=device)
    texels = RNG.random((4, 8)).astype(np.float32)
    texture = wp.Texture2D(texels, device=device)
    out = wp.zeros(8, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(samples, 8, [volume.id, texture, out], device=device)
    graph = reloaded(tmp_path, device, capture, outputs={"out": out})
    wp.capture_launch(capture.graph)
    expected = out.numpy()
    x = 0.25 * np.arange(8)
    low = x.astype(int)
    column = values[:, 1, 2]
    of_volume = column[low] + (x - low) * (column[low + 1] - column[low])
    assert (expected - of_volume > 0).all(), "the texture adds to it"
    del volume, texture
    gc.collect()
    wp.capture_launch(graph)
    assert (result(graph, "out", out) == expected).all()


def test_another_process(device, tmp_path):
    points = wp.array(RNG.random((200, 3)), dtype=wp.vec3, device=device)
    queries = wp.array(QUERIES, dtype=wp.vec3, device=device)
    mesh, grid = cube(device), wp.HashGrid(4, 4, 4, device=device)
    grid.build(points, 0.2)
    out, count = wp.zeros(50, device=device), wp.zeros(200, dtype=int, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        mesh.refit()
        grid.build(points, 0.2)
        wp.launch(distances, 50, [mesh.id, queries, out], device=device)
        wp.launch(neighbours, 200, [grid.id, points, 0.2, count], device=device)
    wp.capture_save(capture.graph, tmp_path / "g", outputs={"out": out, "count": count})
    wp.capture_launch(capture.graph)
    program = f"""
import numpy as np
import warp as wp
graph = wp.capture_load({str(tmp_path / "g")!r}, device={str(device)!r})
wp.capture_launch(graph)
out = wp.zeros(50, device={str(device)!r})
count = wp.zeros(200, dtype=int, device={str(device)!r})
graph.get_param("out", out)
graph.get_param("count", count)
np.save({str(tmp_path / "out.npy")!r}, out.numpy())
np.save({str(tmp_path / "count.npy")!r}, count.numpy())
"""
    environment = os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")}
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=environment
    )
    assert run.returncode == 0, run.stderr
    assert (np.load(tmp_path / "out.npy") == out.numpy()).all()
    assert (np.load(tmp_path / "count.npy") == count.numpy()).all()


def test_one_file_loaded_twice(device, tmp_path):
    queries = wp.array(QUERIES, dtype=wp.vec3, device=device)
    mesh = cube(device)
    mesh.refit()
    out = wp.zeros(50, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        mesh.refit()
        wp.launch(distances, 50, [mesh.id, queries, out], device=device)
    named = {"points": mesh.points}
    first = reloaded(tmp_path, device, capture, named, {"out": out})
    second = wp.capture_load(tmp_path / "graph", device=device)
    away = wp.array(CUBE + np.float32(1.0), dtype=wp.vec3, device=device)
    second.set_param("points", away)
    for graph in (first, second, first):
        wp.capture_launch(graph)
    assert is_close(result(first, "out", out), to_cube())
    assert is_close(result(second, "out", out), to_cube(1.0))


def test_geometry_that_is_gone(device, tmp_path):
    queries, out = wp.zeros(1, dtype=wp.vec3, device=device), wp.zeros(1, device=device)
    mesh = cube(device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(distances, 1, [mesh.id, queries, out], device=device)
    del mesh
    gc.collect()
    with pytest.raises(wp.WarpError, match="launch of 'distances' has the id of a freed Mesh"):
        wp.capture_save(capture.graph, tmp_path / "g")
    assert not any(tmp_path.iterdir())


def test_damaged_files_are_refused(device, tmp_path):
    queries, out = wp.zeros(1, dtype=wp.vec3, device=device), wp.zeros(1, device=device)
    mesh = cube(device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(distances, 1, [mesh.id, queries, out], device=device)
    wp.capture_save(capture.graph, tmp_path / "g")
    data = (tmp_path / "g.wrp").read_bytes()
    modules = {p.name: p.read_bytes() for p in (tmp_path / "g_modules").iterdir()}
    for at in range(0, len(data), max(1, len(data) // 60)):
        broken = bytearray(data)
        broken[at] ^= 0x40
        with pytest.raises(wp.WarpError, match="Failed to load APIC graph from bytes"):
            wp.capture_load_from_bytes(broken, modules, device=device)
