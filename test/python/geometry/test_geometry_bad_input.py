"""Bad input of geometry: errors, memory that ends, objects freed too early."""

import subprocess
import sys

import numpy as np
import pytest

import warp as wp

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float32)


def triangle(device):
    points = wp.array(CORNERS, dtype=wp.vec3, device=device)
    return wp.Mesh(points, wp.array([0, 1, 2], dtype=int, device=device))


@wp.struct
class Scene:
    mesh: wp.uint64
    scale: float


@wp.kernel
def near(mesh: wp.uint64, out: wp.array(dtype=int)):
    i = wp.tid()
    out[i] = wp.where(wp.mesh_query_point_no_sign(mesh, wp.vec3(0.1, 0.1, 1.0), 9.0).result, 1, 2)


@wp.kernel
def near_of_struct(scene: Scene, out: wp.array(dtype=int)):
    i = wp.tid()
    query = wp.mesh_query_point_no_sign(scene.mesh, wp.vec3(0.1, 0.1, scene.scale), 9.0)
    out[i] = wp.where(query.result, 1, 2)


@wp.kernel
def near_of_array(meshes: wp.array(dtype=wp.uint64), out: wp.array(dtype=int)):
    i = wp.tid()
    query = wp.mesh_query_point_no_sign(meshes[i], wp.vec3(0.1, 0.1, 1.0), 9.0)
    out[i] = wp.where(query.result, 1, 2)


@wp.kernel
def count_all(bvh: wp.uint64, turns: int, out: wp.array(dtype=int)):
    i = wp.tid()
    for _turn in range(turns):
        for _one in wp.bvh_query_aabb(bvh, wp.vec3(-9.0), wp.vec3(9.0)):
            out[i] += 1


def test_a_handle_in_a_struct_is_checked_where_it_is_used(device):
    mesh, other = triangle(device), wp.HashGrid(2, 2, 2, device=device)
    scene = Scene()
    scene.scale = 1.0
    out = wp.zeros(2, dtype=int, device=device)
    found = []
    for id in (mesh.id, other.id, 0, 2**63 + 12345):
        scene.mesh = id
        wp.launch(near_of_struct, 2, inputs=[scene, out], device=device)
        found.append(out.numpy().tolist())
    assert found == [[1, 1], [2, 2], [2, 2], [2, 2]]
    scene.mesh = mesh.id
    del mesh
    wp.launch(near_of_struct, 2, inputs=[scene, out], device=device)
    assert out.numpy().tolist() == [2, 2]


def test_handles_in_an_array_are_checked_one_by_one(device):
    mesh, gone, bvh_like = triangle(device), triangle(device), wp.HashGrid(2, 2, 2, device=device)
    ids = wp.array([mesh.id, gone.id, bvh_like.id, 7], dtype=wp.uint64, device=device)
    del gone
    out = wp.zeros(4, dtype=int, device=device)
    wp.launch(near_of_array, 4, inputs=[ids, out], device=device)
    assert out.numpy().tolist() == [1, 2, 2, 2]


def test_a_graph_finds_nothing_in_what_was_freed_after_its_capture(device):
    mesh = triangle(device)
    out = wp.zeros(3, dtype=int, device=device)
    wp.launch(near, 3, inputs=[mesh.id, out], device=device)
    with wp.ScopedCapture(device=device) as capture:
        wp.launch(near, 3, inputs=[mesh.id, out], device=device)
    wp.capture_launch(capture.graph)
    assert out.numpy().tolist() == [1, 1, 1]
    del mesh
    wp.capture_launch(capture.graph)
    assert out.numpy().tolist() == [2, 2, 2]


def test_freed_while_kernels_that_search_it_are_queued(device):
    """On a GPU the launches wait for each other when the hierarchy goes."""
    n, turns = 2000, 20
    low = wp.array(np.random.default_rng(0).random((n, 3)), dtype=wp.vec3, device=device)
    bvh = wp.Bvh(low, low)
    out = wp.zeros(64, dtype=int, device=device)
    for _ in range(8):
        wp.launch(count_all, 64, inputs=[bvh.id, turns, out], device=device)
    del bvh
    # Memory that is free again is taken and overwritten.
    others = [wp.full(200_000, 7, dtype=int, device=device) for _ in range(8)]
    assert (out.numpy() == 8 * turns * n).all()
    assert all((other.numpy() == 7).all() for other in others)


def refusals(device):
    x, i = wp.zeros(3, dtype=wp.vec3, device=device), wp.zeros(3, dtype=int, device=device)
    square = wp.zeros((3, 3), dtype=wp.vec3, device=device)
    wide = wp.zeros(6, dtype=wp.vec3, device=device)
    longs = wp.zeros(3, dtype=wp.int64, device=device)
    floats = wp.zeros(3, dtype=float, device=device)
    far = wp.array([[3e9, 0.0, 0.0]], dtype=wp.vec3, device=device)
    grid = wp.HashGrid(4, 4, 4, device=device)
    runtime, of_type = RuntimeError, TypeError
    return {
        "points of two dimensions": (runtime, "packed", lambda: wp.Mesh(square, i)),
        "points with gaps": (runtime, "packed", lambda: wp.Mesh(wide[::2], i)),
        "points of NumPy": (runtime, "ndarray", lambda: wp.Mesh(CORNERS, i)),
        "no points": (runtime, "NoneType", lambda: wp.Mesh(None, i)),
        "indices of 64 bits": (runtime, "int64", lambda: wp.Mesh(x, longs)),
        "indices that are floats": (runtime, "float32", lambda: wp.Mesh(x, floats)),
        "too few velocities": (
            *(runtime, "3 points, but 2 velocities"),
            lambda: wp.Mesh(x, i, velocities=wp.zeros(2, dtype=wp.vec3, device=device)),
        ),
        "boxes of two dimensions": (runtime, "packed", lambda: wp.Bvh(square, square)),
        "boxes of floats": (runtime, "float32", lambda: wp.Bvh(floats, x)),
        "grid of NumPy": (of_type, "ndarray", lambda: grid.build(CORNERS, 1.0)),
        "grid of floats": (of_type, "float32", lambda: grid.build(floats, 1.0)),
        "radius beyond all": (ValueError, "radius", lambda: grid.build(x, float("inf"))),
        "negative room": (ValueError, "number of points", lambda: grid.reserve(-1)),
        "voxels beyond 32 bits": (
            *(runtime, "2\\^31"),
            lambda: wp.Volume.allocate_by_voxels(far, 1.0, device=device),
        ),
        "tiles beyond 32 bits": (
            *(runtime, "2\\^31"),
            lambda: wp.Volume.allocate_by_tiles(far, 1.0, device=device),
        ),
        "as many cells as 32 bits count": (
            *(runtime, "2\\^31"),
            lambda: wp.HashGrid(2**11, 2**10, 2**10, device=device),
        ),
        "more indices than an array has": (
            *(ValueError, "2147483647"),
            lambda: wp.Mesh(x, wp.array(ptr=i.ptr, dtype=int, shape=3 * 2**31, device=device)),
        ),
    }


@pytest.mark.parametrize("case", refusals("cpu"))
def test_what_is_refused(device, case):
    error, message, make = refusals(device)[case]
    with pytest.raises(error, match=message):
        make()


@pytest.mark.cuda
def test_arrays_of_different_devices_are_refused():
    here, there = (wp.zeros(3, dtype=wp.vec3, device=one) for one in ("cpu", "cuda:0"))
    corners = wp.array([0, 1, 2], dtype=int, device="cuda:0")
    out = wp.zeros(1, dtype=int, device="cuda:0")
    with pytest.raises(RuntimeError, match="cpu"):
        wp.Mesh(here, corners)
    with pytest.raises(RuntimeError, match="cpu"):
        wp.Bvh(there, here)
    with pytest.raises(RuntimeError, match="cpu"):
        wp.HashGrid(2, 2, 2, device="cuda:0").build(here, 1.0)
    mesh = triangle("cpu")
    with pytest.raises(wp.WarpLaunchError, match="argument 'mesh'.*'cpu'"):
        wp.launch(near, 1, inputs=[mesh.id, out], device="cuda:0")


def test_points_that_are_not_finite_have_no_voxel(device):
    points = [[np.nan, 0, 0], [1, 2, 3], [0, np.inf, 0], [0, 0, -np.inf]]
    given = wp.array(points, dtype=wp.vec3, device=device)
    volume = wp.Volume.allocate_by_voxels(given, 1.0, device=device)
    assert volume.get_voxels().numpy().tolist() == [[1, 2, 3]]
    ends = wp.array([[2**31 - 1, -(2**31), 0]], dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_voxels(ends, 1.0, device=device)
    assert volume.get_voxels().numpy().tolist() == [[2**31 - 1, -(2**31), 0]]


PROGRAM = """
import resource, sys
import numpy as np
import warp as wp

n = 300_000
rng = np.random.default_rng(0)
x = wp.array(rng.random((n, 3)), dtype=wp.vec3, device="cpu")
faces = wp.array(rng.integers(0, n, 3 * n), dtype=int, device="cpu")

@wp.kernel
def faces_found(mesh: wp.uint64, out: wp.array(dtype=int)):
    for _ in wp.mesh_query_aabb(mesh, wp.vec3(-1.0), wp.vec3(2.0)):
        out[0] += 1

@wp.kernel
def points_found(grid: wp.uint64, out: wp.array(dtype=int)):
    for _ in wp.hash_grid_query(grid, wp.vec3(0.5), 0.5):
        out[0] += 1

def count(kernel, id):
    out = wp.zeros(1, dtype=int, device="cpu")
    wp.launch(kernel, 1, inputs=[id, out], device="cpu")
    return int(out.numpy()[0])

mesh = wp.Mesh(x, faces, support_winding_number=True)
grid = wp.HashGrid(64, 64, 64, device="cpu")
grid.build(x, 1.0 / 64)
wanted = count(faces_found, mesh.id), count(points_found, grid.id)
makers = {
    "mesh": lambda: wp.Mesh(x, faces, support_winding_number=True),
    "hierarchy": lambda: wp.Bvh(x, x),
    "rebuild": mesh.rebuild,
    "hash grid": lambda: wp.HashGrid(256, 256, 256, device="cpu").build(x, 1.0 / 64),
}
ended = {name: 0 for name in makers}
for extra in (0, 1, 2, 4, 6, 9, 13, 18, 25, 35, 50, 1000):
    for name, make in makers.items():
        used = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        most = resource.RLIM_INFINITY
        resource.setrlimit(resource.RLIMIT_AS, (used + (extra << 20), most))
        try:
            make()
            error = None
        except MemoryError as problem:
            error = problem
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (most, most))
        ended[name] += error is not None
        assert error is None or "out of memory" in str(error), error
        found = count(faces_found, mesh.id), count(points_found, grid.id)
        assert found == wanted, (extra, name, found, wanted)
    assert extra < 1000 or error is None
print(min(ended.values()))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
def test_memory_that_ends_in_a_build_is_an_error_and_nothing_is_lost(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout.split()[-1]) >= 1
