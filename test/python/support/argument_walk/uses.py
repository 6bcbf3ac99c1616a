"""Uses of objects after an attribute of theirs was replaced by a wrong one."""

import numpy as np
from support.argument_walk import objects

import warp as wp
import warp.sparse as sparse


@wp.kernel
def near(mesh: wp.uint64, out: wp.array(dtype=float)):
    i = wp.tid()
    query = wp.mesh_query_point(mesh, wp.vec3(0.1, 0.2, 0.3), 10.0)
    out[i] = float(query.face)


@wp.kernel
def boxes(bvh: wp.uint64, out: wp.array(dtype=float)):
    i = wp.tid()
    for found in wp.bvh_query_aabb(bvh, wp.vec3(-1.0), wp.vec3(2.0)):
        out[i] += float(found)


@wp.kernel
def cells(grid: wp.uint64, out: wp.array(dtype=float)):
    i = wp.tid()
    for found in wp.hash_grid_query(grid, wp.vec3(0.1), 1.0):
        out[i] += float(found)


@wp.kernel
def texels(texture: wp.Texture2D, out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.texture_sample(texture, wp.vec2(float(i) * 0.1, 0.5), dtype=float)


@wp.kernel
def voxels(volume: wp.uint64, out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = wp.volume_lookup_f(volume, i, 0, 0)


@wp.kernel
def fields(pair: objects.Pair, out: wp.array(dtype=float)):
    i = wp.tid()
    if i < pair.b.shape[0]:
        out[i] = pair.a + pair.v[0] + pair.b[i]


def _launch(kernel, held):
    wp.launch(kernel, 4, [held, objects.floats()], device="cpu")


def _mesh(held):
    held.refit()
    _launch(near, held.id)
    held.rebuild()
    _launch(near, held.id)


def _bvh(held):
    held.refit()
    _launch(boxes, held.id)
    held.rebuild()


def _grid(held):
    _launch(cells, held.id)
    held.build(objects.corners(), 1.0)


def _texture(held):
    held.numpy()
    _launch(texels, held)
    held.copy_from(np.ones((4, 4), np.float32))


def _array(held):
    held.numpy()
    held.fill_(1.0)
    wp.clone(held)
    wp.launch(objects.scale, 4, [held, 2.0], device="cpu")


def _matrix(held):
    held @ objects.floats()
    sparse.bsr_transposed(held)
    sparse.bsr_copy(held)
    held.nnz_sync()


def _optimizer(held):
    held.step([objects.floats()])


def _volume(held):
    _launch(voxels, held.id)
    held.get_voxels()
    held.get_tiles()


USES = {
    "array": _array,
    "Mesh": _mesh,
    "Bvh": _bvh,
    "HashGrid": _grid,
    "Texture2D": _texture,
    "Volume": _volume,
    "BsrMatrix": _matrix,
    "Pair": lambda held: _launch(fields, held),
    "Tape": lambda held: held.backward(grads={}),
    "Graph": wp.capture_launch,
    "Launch": lambda held: held.launch(),
    "LinearOperator": lambda held: wp.optim.linear.cg(held, objects.floats(), objects.floats()),
    "Adam": _optimizer,
    "SGD": _optimizer,
    "LBFGS": lambda held: held.step(lambda: objects.floats(1)),
    "MarchingCubes": lambda held: held.surface(wp.zeros((4, 4, 4), device="cpu"), 0.5),
    "ScopedTimer": lambda held: held.__enter__(),
}
