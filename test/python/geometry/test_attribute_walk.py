"""Any value for any attribute of geometry: refused by name, or all goes on within memory."""

import numpy as np
import pytest

import warp as wp

POINTS = np.random.default_rng(0).random((30, 3)).astype(np.float32)


def vectors(values):
    return wp.array(values, dtype=wp.vec3, device="cpu")


def ints(values):
    return wp.array(values, dtype=int, device="cpu")


@wp.kernel
def ask_bvh(bvh: wp.uint64, out: wp.array(dtype=float)):
    for _ in wp.bvh_query_aabb(bvh, wp.vec3(-9.0), wp.vec3(9.0)):
        out[0] += 1.0


@wp.kernel
def ask_mesh(mesh: wp.uint64, out: wp.array(dtype=float)):
    q = wp.mesh_query_point(mesh, wp.vec3(0.1), 9.0)
    out[0] = wp.length(wp.mesh_eval_velocity(mesh, q.face, q.u, q.v))
    out[1] = wp.length(wp.mesh_eval_position(mesh, q.face, q.u, q.v))


@wp.kernel
def ask_grid(grid: wp.uint64, out: wp.array(dtype=float)):
    for _ in wp.hash_grid_query(grid, wp.vec3(0.1), 1.0):
        out[0] += 1.0


@wp.kernel
def ask_volume(volume: wp.uint64, out: wp.array(dtype=float)):
    out[0] = wp.volume_sample_f(volume, wp.vec3(1.0), wp.Volume.LINEAR)


def make_bvh():
    return wp.Bvh(vectors(POINTS), vectors(POINTS + np.float32(0.1)), groups=ints(np.zeros(30)))


def make_mesh():
    corners, groups = ints(np.arange(30)), ints(np.zeros(10))
    return wp.Mesh(vectors(POINTS), corners, velocities=vectors(POINTS), groups=groups)


def make_grid():
    grid = wp.HashGrid(4, 4, 4, device="cpu")
    grid.build(vectors(POINTS), 0.5)
    return grid


def make_volume():
    return wp.Volume.load_from_numpy(np.ones((8, 8, 8), np.float32), device="cpu")


KINDS = {
    "Bvh": (make_bvh, ask_bvh, ["refit", "rebuild"]),
    "Mesh": (make_mesh, ask_mesh, ["refit", "rebuild"]),
    "HashGrid": (make_grid, ask_grid, ["build"]),
    "Volume": (make_volume, ask_volume, ["get_voxels", "get_tiles", "array"]),
}


def values():
    """Values of wrong types, and arrays of wrong lengths, ranks, types, layouts and contents."""
    return [
        *(None, -1, 10**9, "x", [], np.zeros(3)),
        *(vectors(POINTS[:2]), vectors(np.tile(POINTS, (2, 1)))[::2]),
        *(wp.zeros((2, 15), dtype=wp.vec3, device="cpu"), wp.zeros(0, dtype=int, device="cpu")),
        *(ints(np.full(30, 10**8)), ints(np.full(10, -5)), vectors(np.full((30, 3), np.nan))),
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_replaced_attributes(kind):
    make, ask, updates = KINDS[kind]
    sample = make()
    names = [name for name in dir(sample) if not name.startswith("_")]
    names = [name for name in names if not callable(getattr(sample, name))]
    out, accepted = wp.zeros(2, dtype=float, device="cpu"), 0
    named = (RuntimeError, ValueError, TypeError, AttributeError)
    for name in names:
        for value in values():
            one = make()
            try:
                setattr(one, name, value)
            except named as error:
                assert len(str(error)) > 10
                continue
            accepted += 1
            for update in updates:
                given = (vectors(POINTS), 0.5) if update == "build" else ()
                try:
                    getattr(one, update)(*given)
                except named as error:
                    assert len(str(error)) > 10
            try:
                wp.launch(ask, 1, inputs=[one.id, out], device="cpu")
            except named as error:
                assert len(str(error)) > 10
    # Heaps that were written beyond are noticed here, at the latest.
    junk = [bytearray(size) for size in range(1, 2000)]
    assert accepted and len(junk) == 1999
