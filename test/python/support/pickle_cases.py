"""An object of every public class, and plain facts of it that a copy in another process has, too.

A case is a function; a parameter gets another case's object. `facts(value)` uses what the object is
for: forms are integrated, operators applied.
"""

import numpy as np

import warp as wp
import warp.autograd
import warp.distributed as wd
import warp.optim as wo
from pickle_fem_cases import cells, facts_of_forms, facts_of_matrix, lifted
from pickle_registry import case, numbers_of, stays
from warp import sparse
from warp.optim import linear

wp.config.quiet = True


@wp.func
def twice(x: float):
    return 2.0 * x


@wp.kernel
def double(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = twice(x[i])


# Linear algebra and optimisers.


@case
def matrix():
    rows, columns = cells(0, 0, 1, 1, 2), cells(0, 1, 0, 1, 2)
    values = wp.array([2.0, 0.5, 0.5, 3.0, 4.0], dtype=float)
    return sparse.bsr_from_triplets(3, 3, rows, columns, values)


@case
def triplets():
    return sparse.BsrTripletMap(4)


@case
def sum_arrays():
    return sparse.bsr_axpy_work_arrays()


@case
def product_arrays():
    return sparse.bsr_mm_work_arrays()


@case
def sparse_operator(matrix):
    return linear.aslinearoperator(matrix)


@case
def dense_operator():
    return linear.aslinearoperator(wp.array(np.arange(9.0).reshape(3, 3), dtype=float))


@case
def jacobi(matrix):
    return linear.preconditioner(matrix)


@case
def fsai(matrix):
    return linear.FSAI(matrix)


@case
def chebyshev(matrix):
    return linear.Chebyshev(matrix)


@case
def factors(matrix):
    return linear.ldlt(matrix)


def vectors():
    return wp.array([1.0, 2.0, 3.0], dtype=float), wp.zeros(3, dtype=float)


@case
def cg(matrix):
    return linear.CG(matrix, *vectors())


@case
def cr(matrix):
    return linear.CR(matrix, *vectors())


@case
def bicgstab(matrix):
    return linear.BiCGSTAB(matrix, *vectors())


@case
def gmres(matrix):
    return linear.GMRES(matrix, *vectors())


def parameters():
    return [wp.array([1.0, -2.0], dtype=float, requires_grad=True)]


@wp.kernel
def bowl(x: wp.array(dtype=float), loss: wp.array(dtype=float)):
    i = wp.tid()
    d = x[i] * x[i] - float(i + 1)
    wp.atomic_add(loss, 0, d * d)


def stepped(optimiser):
    """An optimiser that has a history."""
    x = optimiser.params[0]

    def closure():
        loss = wp.zeros(1, dtype=float, requires_grad=True)
        x.grad.zero_()
        with wp.Tape() as tape:
            wp.launch(bowl, 2, [x, loss])
        tape.backward(loss)
        return loss

    for _ in range(2):
        if isinstance(optimiser, wo.LBFGS):
            optimiser.step(closure)
        else:
            closure()
            optimiser.step([x.grad])
    return optimiser


@case
def adam():
    return stepped(wo.Adam(parameters()))


@case
def sgd():
    return stepped(wo.SGD(parameters(), momentum=0.5))


@case
def lbfgs():
    return stepped(wo.LBFGS(parameters(), max_iter=1))


@case
def batched_lbfgs():
    return wo.BatchedLBFGS(wp.zeros((2, 3), dtype=float, requires_grad=True))


@case
def batched_least_squares():
    x, residuals = (wp.zeros((2, n), dtype=float, requires_grad=True) for n in (3, 4))
    return wo.BatchedLevenbergMarquardt(x, residuals)


# The core.


@case
def plain_array():
    return wp.array([1.0, 2.0], dtype=float)


@case
def picked():
    return wp.array([1.0, 2.0, 3.0], dtype=float)[cells(0, 2)]


@case
def array_type():
    return wp.array(dtype=wp.vec3)


@case
def kernel():
    return double


@case
def function():
    return twice


@case
def device():
    return wp.get_device("cpu")


@case
def tape():
    return wp.Tape()


@stays("record where `backward` is to run")
def recorded_tape():
    made = wp.Tape()
    with made:
        wp.launch(double, 2, [wp.zeros(2, dtype=float, requires_grad=True)])
    return made


@case
def saved_graph():
    x = wp.zeros(2, dtype=float)
    with wp.ScopedCapture(apic=True) as capture:
        x.fill_(1.0)
    return capture.graph


@stays("or capture the work anew where it is to run")
def graph():
    x = wp.zeros(2, dtype=float)
    with wp.ScopedCapture() as capture:
        x.fill_(1.0)
    return capture.graph


@stays("record it where it is to run")
def launch():
    return wp.launch(double, 2, [wp.zeros(2, dtype=float)], record_cmd=True)


@stays("send its kernels")
def module():
    return double.module


@case
def bvh():
    return wp.Bvh(wp.zeros(2, dtype=wp.vec3), wp.ones(2, dtype=wp.vec3))


@case
def hash_grid():
    return wp.HashGrid(4, 4, 4)


@case
def mesh():
    return wp.Mesh(lifted(), wp.array([0, 1, 2, 1, 3, 2], dtype=int))


@case
def texture():
    return wp.Texture2D(np.arange(16, dtype=np.float32).reshape(4, 4))


@case
def cubes():
    return wp.MarchingCubes(4, 4, 4)


@case
def nets():
    import warp.geometry

    return warp.geometry.IsoSurfaceNets(4, 4, 4)


@case
def adjacency():
    return wp.utils.MeshAdjacency(np.array([[0, 1, 2], [1, 3, 2]]), 2)


@case
def edge(adjacency):
    return next(iter(adjacency.edges.values()))


@stays("make one in each process by `wd.init`")
def communicator():
    return wd.init()


@stays("make one in each process by `wd.init`")
def blocks():
    return wd.Blocks((8,))


@stays("make one in each process by `wd.init`")
def particles():
    return wd.Particles(((0.0,), (1.0,)), 0.1)


@stays("make one in each process by `wd.init`")
def nodes():
    return wd.Graph([0], [1])


@stays("make one in each process by `wd.init`")
def rows():
    return wd.Matrix(wd.Graph([0], [1]), [0, 1], [0, 1], [1.0, 2.0])


@stays("make one in each process by `wd.init`")
def operator_of_rows():
    return wd.LinearOperator(rows())


@case
def message(plain_array):
    return wd.Message(0, plain_array, None, 0, 0)


@case
def shared_memory(plain_array):
    _, handle = wd.share(plain_array)
    return handle


@case
def build_options():
    return wp.ModuleBuildOptions(extra_cpu_preamble="int one;")


@case
def timing():
    return wp.TimingResult(wp.get_device("cpu"), "a", 1, 0.5)


@case
def metadata():
    return wp.autograd.FunctionMetadata("f")


@case
def manifest():
    return wp.Manifest([kernel_manifest()])


@case
def kernel_manifest():
    return wp.KernelManifest("k", "m", "f", {"add": 1}, (), (), (), 1.0)


@case
def box():
    return wd.Blocks((8,)).interior


def facts(value):
    """Results of an object, as plain values."""
    if isinstance(value, type):
        return value.__name__
    if hasattr(value, "numpy"):
        return numbers_of(value)
    if type(value).__module__.startswith("warp._src.fem"):
        return facts_of_forms(value)
    if isinstance(value, linear.LinearOperator):
        x, z = vectors()
        value.matvec(x, z, z, 1.0, 0.0)
        return numbers_of(z)
    if isinstance(value, linear.DirectSolver):
        return numbers_of(value.solve(vectors()[0]))
    if isinstance(value, linear.LinearSolverState):
        value()
        return numbers_of(value.x)
    if isinstance(value, wd.Shared):
        return numbers_of(value.open())
    if isinstance(value, sparse.BsrMatrix):
        return facts_of_matrix(value)
    if isinstance(value, (wo.Adam, wo.SGD, wo.LBFGS)):
        return numbers_of(stepped(value).params[0])
    if isinstance(value, wp.Kernel):
        x = wp.array([1.0, 2.0], dtype=float)
        wp.launch(value, 2, [x])
        return numbers_of(x)
    if isinstance(value, wp.Function):
        return value(3.0)
    if isinstance(value, wp.Mesh):
        return [numbers_of(value.points), numbers_of(value.indices)]
    if isinstance(value, wp.Bvh):
        return [numbers_of(value.lowers), numbers_of(value.uppers)]
    if isinstance(value, wp.utils.MeshAdjacency):
        return [attributes(one) for _, one in sorted(value.edges.items())]
    if isinstance(value, wp.Volume):
        return [value.get_voxel_size(), numbers_of(value.get_voxels())]
    return [type(value).__qualname__, *attributes(value)]


def attributes(value):
    """Public attributes that are plain values or arrays; addresses are those of a process."""
    known = value._asdict() if hasattr(value, "_asdict") else getattr(value, "__dict__", {})
    found = []
    for name, one in sorted(known.items()):
        if name.startswith("_") or name == "id":
            continue
        if isinstance(one, (bool, int, float, np.integer, str, tuple, list)):
            found.append(f"{name} = {one}")
        elif isinstance(one, wp.array):
            found.append([name, numbers_of(one)])
    return found
