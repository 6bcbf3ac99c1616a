"""An object of every public class, and plain facts of it that a copy in another process has, too.

A case is a function; a parameter gets another case's object. `facts(name, value)` uses what the
object is for: forms are integrated, operators applied.
"""

import inspect

import numpy as np

import warp as wp
import warp.autograd
import warp.distributed as wd
import warp.optim as wo
from warp import fem, sparse
from warp.optim import linear

wp.config.quiet = True
CASES: dict = {}
# The end of an error's message for what stays in its process.
STAYS: dict = {}


def case(function):
    CASES[function.__name__] = function
    return function


def stays(words):
    def mark(function):
        STAYS[function.__name__] = function, words
        return function

    return mark


def make(name):
    """The object of a case."""
    function = CASES[name] if name in CASES else STAYS[name][0]
    return function(*map(make, inspect.signature(function).parameters))


@wp.func
def twice(x: float):
    return 2.0 * x


@wp.kernel
def double(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = twice(x[i])


@wp.func
def tilted(x: wp.vec2):
    return x[0] + 2.0 * x[1]


@fem.integrand
def unit(s: fem.Sample):
    return 1.0


@fem.integrand
def value_of(s: fem.Sample, u: fem.Field):
    return u(s)


@fem.integrand
def load(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def product(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def cell_of(
    s: fem.Sample, domain: fem.Domain, at: wp.array(dtype=wp.vec2), found: wp.array(dtype=int)
):
    found[s.qp_index] = fem.lookup(domain, at[s.qp_index]).element_index


POINTS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)], np.float32)
FLAT = np.array([[0, 0], [1, 0], [0, 1], [1.5, 1]], np.float32)


def cells(*rows):
    return wp.array(np.array(rows), dtype=int)


def plane():
    return wp.array(FLAT, dtype=wp.vec2)


def lifted():
    return wp.array(np.c_[FLAT, FLAT[:, 0]], dtype=wp.vec3)


# Geometries of finite elements.


@case
def grid_2d():
    return fem.Grid2D(res=wp.vec2i(3, 2), bounds_hi=wp.vec2(2.0, 1.0))


@case
def grid_3d():
    return fem.Grid3D(res=wp.vec3i(2, 3, 2))


@case
def triangles():
    return fem.Trimesh2D(cells([0, 1, 2], [1, 3, 2]), plane(), build_bvh=True)


@case
def triangles_in_space():
    return fem.Trimesh3D(cells([0, 1, 2], [1, 3, 2]), lifted())


@case
def quads():
    return fem.Quadmesh2D(cells([0, 1, 3, 2]), plane())


@case
def quads_in_space():
    return fem.Quadmesh3D(cells([0, 1, 3, 2]), lifted())


@case
def tets():
    return fem.Tetmesh(cells([0, 4, 2, 1]), wp.array(POINTS, dtype=wp.vec3))


@case
def hexes():
    return fem.Hexmesh(cells([0, 4, 6, 2, 1, 5, 7, 3]), wp.array(POINTS, dtype=wp.vec3))


@case
def voxels():
    places = wp.array([[0, 0, 0], [2, 0, 0], [2, 2, 0]], dtype=wp.vec3i)
    return wp.Volume.allocate_by_voxels(places, 0.5)


@case
def nanogrid(voxels):
    return fem.Nanogrid(voxels)


@case
def adaptive_nanogrid(voxels):
    return fem.AdaptiveNanogrid(voxels, wp.array([1, 1, 0], dtype=wp.uint8), 2)


@case
def deformed_grid(grid_2d):
    field = fem.make_polynomial_space(grid_2d, dtype=wp.vec2).make_field()
    fem.interpolate(stretched, dest=field)
    return field.make_deformed_geometry()


@fem.integrand
def stretched(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    return wp.vec2(0.5 * x[0], 0.0)


# Parts, domains and rules.


@case
def linear_partition(grid_2d):
    return fem.LinearGeometryPartition(grid_2d, 0, 2)


@case
def listed_partition(grid_2d):
    return fem.ExplicitGeometryPartition(grid_2d, cells(1, 1, 0, 0, 1, 0))


@case
def all_cells(triangles):
    return fem.Cells(triangles)


@case
def all_sides(grid_2d):
    return fem.Sides(grid_2d)


@case
def boundary(hexes):
    return fem.BoundarySides(hexes)


@case
def frontier(linear_partition):
    return fem.FrontierSides(linear_partition)


@case
def subdomain(grid_2d):
    return fem.Subdomain(fem.Cells(grid_2d), element_indices=cells(0, 4))


@case
def regular_rule(grid_3d):
    return fem.RegularQuadrature(fem.Cells(grid_3d), order=2)


@case
def nodal_rule(space):
    return fem.NodalQuadrature(fem.Cells(space.geometry), space)


@case
def listed_rule(grid_2d):
    points, weights = wp.zeros((6, 1), dtype=wp.vec3), wp.full((6, 1), 0.5, dtype=float)
    return fem.ExplicitQuadrature(fem.Cells(grid_2d), points, weights)


@case
def particle_rule(grid_2d):
    points = wp.array([[0.1, 0.1], [1.2, 0.3]], dtype=wp.vec2)
    return fem.PicQuadrature(
        fem.Cells(grid_2d), points, measures=wp.array([0.25, 2.0], dtype=float)
    )


# Spaces and fields.


@case
def space(grid_2d):
    return fem.make_polynomial_space(grid_2d, degree=2)


@case
def vector_space(triangles):
    basis = fem.ElementBasis.NEDELEC_FIRST_KIND
    return fem.make_polynomial_space(triangles, degree=1, element_basis=basis)


@case
def tensor_space(grid_2d):
    mapper = fem.SymmetricTensorMapper(wp.mat22)
    return fem.make_polynomial_space(grid_2d, degree=1, dof_mapper=mapper)


@case
def point_basis(particle_rule):
    return fem.PointBasisSpace(particle_rule)


@case
def basis(space):
    return space.basis


@case
def shape_function(space):
    return space.basis.shape


@case
def topology(space):
    return space.topology


@case
def node_partition(space):
    part = fem.LinearGeometryPartition(space.geometry, 0, 2)
    return fem.make_space_partition(space.topology, part)


@case
def node_restriction(test_functions):
    return test_functions.space_restriction


@case
def field(space):
    made = space.make_field()
    made.dof_values.assign(np.arange(made.dof_values.size, dtype=np.float32))
    return made


@case
def test_functions(space):
    return fem.make_test(space)


@case
def trial_functions(space):
    return fem.make_trial(space)


@case
def uniform_field(grid_2d):
    return fem.UniformField(fem.Cells(grid_2d), 3.0)


@case
def implicit_field(grid_2d):
    return fem.ImplicitField(fem.Cells(grid_2d), tilted)


@case
def nonconforming_field(field, triangles):
    return fem.NonconformingField(fem.Cells(triangles), field)


@case
def integrand():
    return unit


@case
def element(space):
    return space.basis.element


@case
def reference_cell(grid_2d):
    return grid_2d.reference_cell()


@case
def operator():
    return fem.grad


@case
def symmetric_mapper():
    return fem.SymmetricTensorMapper(wp.mat22)


@case
def skew_mapper():
    return fem.SkewSymmetricTensorMapper(wp.mat22)


@case
def temporary():
    made = fem.borrow_temporary(None, 4, float)
    made.fill_(2.0)
    return made


@case
def temporaries():
    return fem.TemporaryStore()


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


def numbers_of(value):
    """An array, or what has one, as nested lists."""
    return np.round(np.asarray(value.numpy(), float), 5).tolist()


def rounded(value):
    return np.round(np.asarray(value, float), 5).tolist()


def facts_of_forms(value):
    """Integrals, of what finite elements are made of."""
    if isinstance(value, fem.Geometry):
        domains = fem.Cells(value), fem.BoundarySides(value)
        if isinstance(value, fem.Trimesh2D):
            # By the hierarchy of its cells.
            found = wp.zeros(2, dtype=int)
            places = wp.array([[0.2, 0.2], [0.9, 0.8]], dtype=wp.vec2)
            domain = fem.Cells(value)
            fem.interpolate(cell_of, at=domain, dim=2, values={"at": places, "found": found})
            return found.numpy().tolist()
        return [value.side_count(), *(rounded(fem.integrate(unit, domain=one)) for one in domains)]
    if isinstance(value, fem.GeometryPartition):
        return facts_of_forms(fem.Cells(value))
    if isinstance(value, fem.GeometryDomain):
        return [value.element_count(), rounded(fem.integrate(unit, domain=value))]
    if isinstance(value, fem.Quadrature):
        return rounded(fem.integrate(unit, quadrature=value))
    if isinstance(value, fem.FunctionSpace):
        return [value.dtype.__name__, value.node_count(), numbers_of(value.node_positions())]
    if isinstance(value, fem.ElementBasis):
        return value.name
    if isinstance(value, fem.Integrand):
        return rounded(fem.integrate(value, domain=fem.Cells(grid_2d())))
    if type(value).__name__ == "TestField":
        return numbers_of(fem.integrate(load, fields={"v": value}))
    if type(value).__name__ == "TrialField":
        test = fem.make_test(value.space)
        return facts(fem.integrate(product, fields={"u": value, "v": test}))
    if isinstance(value, fem.FieldLike):
        domain = getattr(value, "domain", None) or fem.Cells(value.geometry)
        return rounded(fem.integrate(value_of, domain=domain, fields={"u": value}))
    counts = ("node_count", "VALUE_SIZE", "DOF_SIZE", "NODES_PER_ELEMENT")
    found = [getattr(value, name, None) for name in counts]
    return [one() if callable(one) else one for one in found]


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
        return [numbers_of(one) for one in (value.offsets, value.columns, value.values)]
    if isinstance(value, (wo.Adam, wo.SGD, wo.LBFGS)):
        return numbers_of(stepped(value).params[0])
    if isinstance(value, wp.Kernel):
        x = wp.array([1.0, 2.0], dtype=float)
        wp.launch(value, 2, [x])
        return numbers_of(x)
    return type(value).__qualname__
