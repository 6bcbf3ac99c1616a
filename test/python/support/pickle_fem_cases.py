"""Objects of `warp.fem` for pickles; forms are integrated with what a copy is."""

import numpy as np

import warp as wp
from pickle_registry import case, numbers_of, rounded
from warp import fem


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


def facts_of_matrix(value):
    """Numbers of a sparse matrix."""
    return [numbers_of(one) for one in (value.offsets, value.columns, value.values)]


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
        return facts_of_matrix(fem.integrate(product, fields={"u": value, "v": test}))
    if isinstance(value, fem.FieldLike):
        domain = getattr(value, "domain", None) or fem.Cells(value.geometry)
        return rounded(fem.integrate(value_of, domain=domain, fields={"u": value}))
    counts = ("node_count", "VALUE_SIZE", "DOF_SIZE", "NODES_PER_ELEMENT")
    found = [getattr(value, name, None) for name in counts]
    return [one() if callable(one) else one for one in found]
