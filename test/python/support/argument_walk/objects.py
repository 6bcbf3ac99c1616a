"""Objects of the package, whose methods are called and which are arguments themselves."""

import numpy as np

import warp as wp
import warp.optim
import warp.optim.linear as linear
import warp.render
import warp.sparse as sparse


@wp.struct
class Pair:
    a: float
    v: wp.vec3
    b: wp.array(dtype=float)


@wp.struct
class Outer:
    inner: Pair
    m: wp.mat22


@wp.kernel
def scale(x: wp.array(dtype=float), s: float):
    i = wp.tid()
    if i < x.shape[0]:
        x[i] = x[i] * s


@wp.func
def twice(x: float) -> float:
    return x + x


def floats(count=4):
    return wp.ones(count, dtype=float, device="cpu", requires_grad=True)


def ints(*values):
    return wp.array(values, dtype=int, device="cpu")


def corners():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    return wp.array(points, dtype=wp.vec3, device="cpu")


def matrix():
    places = ints(0, 1, 2, 3)
    return sparse.bsr_from_triplets(4, 4, places, places, floats())


def _grid():
    made = wp.HashGrid(4, 4, 4, device="cpu")
    made.build(corners(), 1.0)
    return made


def _graph():
    with wp.ScopedCapture(device="cpu") as capture:
        wp.launch(scale, 4, [floats(), 2.0], device="cpu")
    return capture.graph


def _tape():
    x = floats()
    with wp.Tape() as tape:
        wp.launch(scale, 4, [x, 2.0], device="cpu")
    return tape


def _pair():
    made = Pair()
    made.b = floats()
    return made


def _launch():
    return wp.launch(scale, 4, [floats(), 2.0], device="cpu", record_cmd=True)


def _solver():
    return linear.CG(matrix(), floats(), floats())


RECIPES = {
    "array": floats,
    "array2d": lambda: wp.zeros((3, 4), dtype=wp.vec3, device="cpu"),
    "array of structs": lambda: wp.zeros(3, dtype=Pair, device="cpu"),
    "indexedarray": lambda: wp.indexedarray(floats(), [ints(1, 3)]),
    "vec3": lambda: wp.vec3(1.0, 2.0, 3.0),
    "vec2i": lambda: wp.vec2i(1, 2),
    "vec4h": lambda: wp.vec4h(1.0, 2.0, 3.0, 4.0),
    "mat33": lambda: wp.mat33(1.0),
    "quat": lambda: wp.quat(0.0, 0.0, 0.0, 1.0),
    "transform": lambda: wp.transform(wp.vec3(), wp.quat(0.0, 0.0, 0.0, 1.0)),
    "float32": lambda: wp.float32(0.5),
    "float16": lambda: wp.float16(0.5),
    "int32": lambda: wp.int32(3),
    "uint8": lambda: wp.uint8(3),
    "Pair": _pair,
    "Outer": Outer,
    "Pair type": lambda: Pair,
    "vec3 type": lambda: wp.types.vector(5, float),
    "array type": lambda: wp.array(dtype=float, ndim=2),
    "Mesh": lambda: wp.Mesh(corners(), ints(0, 1, 2, 0, 2, 3)),
    "Bvh": lambda: wp.Bvh(corners(), corners()),
    "HashGrid": _grid,
    "Volume": lambda: wp.Volume.load_from_numpy(np.ones((4, 4, 4), np.float32), device="cpu"),
    "index Volume": lambda: wp.Volume.allocate_by_voxels(corners(), 0.5, device="cpu"),
    "Texture1D": lambda: wp.Texture1D(np.ones(4, "f4"), device="cpu"),
    "Texture2D": lambda: wp.Texture2D(np.ones((4, 4), "f4"), device="cpu"),
    "Texture3D": lambda: wp.Texture3D(np.ones((4, 4, 4), "f4"), device="cpu"),
    "MarchingCubes": lambda: wp.MarchingCubes(4, 4, 4),
    "Device": lambda: wp.get_device("cpu"),
    "Tape": _tape,
    "Graph": _graph,
    "Kernel": lambda: scale,
    "Function": lambda: twice,
    "Launch": _launch,
    "Module": lambda: wp.get_module(__name__),
    "BsrMatrix": matrix,
    "LinearOperator": lambda: linear.aslinearoperator(matrix()),
    "preconditioner": lambda: linear.preconditioner(matrix(), "diag"),
    "CG": _solver,
    "Adam": lambda: wp.optim.Adam([floats()]),
    "SGD": lambda: wp.optim.SGD([floats()]),
    "LBFGS": lambda: wp.optim.LBFGS([floats()]),
    "MeshAdjacency": lambda: wp.utils.MeshAdjacency([[0, 1, 2], [0, 2, 3]], 2),
    "ScopedTimer": lambda: wp.ScopedTimer("walk", print=False),
    "ScopedDevice": lambda: wp.ScopedDevice("cpu"),
    "ScopedCapture": lambda: wp.ScopedCapture(device="cpu"),
    "Logger": wp.get_logger,
}
