"""Problems with known solutions on surfaces, periodic domains, grids of two levels, pairs of grids
that do not conform, and parts of a geometry."""

import math

import numpy as np
import pytest

import fem_programs as programs
import warp as wp
from warp import fem

REAL = wp.float64
Vec2, Vec3 = wp.vec2d, wp.vec3d


# Surfaces: spherical harmonics, on curved cells.


def sphere(kind, n):
    cells, corners = [], []
    line = np.linspace(-1.0, 1.0, n + 1)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            first = sum(map(len, corners))
            a, b = np.meshgrid(line, line, indexing="ij")
            face = np.stack([np.full_like(a, sign), a * sign, b], -1).reshape(-1, 3)
            corners.append(np.roll(face, axis, axis=1))
            for i, j in np.ndindex(n, n):
                at = first + i * (n + 1) + j
                cells.append((at, at + n + 1, at + n + 2, at + 1))
    corners = np.concatenate(corners)
    _, first, index = np.unique(
        np.round(corners, 9), axis=0, return_index=True, return_inverse=True
    )
    cells, corners = index.reshape(-1)[np.array(cells)], corners[first]
    if kind == "Trimesh3D":
        cells = np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    mesh = getattr(fem, kind)(wp.array(cells, dtype=int), wp.array(corners, dtype=Vec3))
    return programs.curved(mesh, lambda x: x / np.linalg.norm(x, axis=1, keepdims=True), 3)


@fem.integrand
def one(s: fem.Sample, domain: fem.Domain):
    return fem.position(domain, s)[0] * REAL(0.0) + REAL(1.0)


@pytest.mark.parametrize("kind", ["Trimesh3D", "Quadmesh3D"])
def test_harmonics_of_a_sphere(kind):
    geometry = sphere(kind, 3)
    cells = fem.Cells(geometry)
    area = float(fem.integrate(one, quadrature=fem.RegularQuadrature(cells, order=10)))
    assert area == pytest.approx(4.0 * math.pi, rel=1e-3)
    space = fem.make_polynomial_space(geometry, degree=3, dtype=REAL)
    fields = programs.fields_of(space)
    a, m = (
        programs.matrix_of(programs.diffusion, fields, cells, 8),
        programs.matrix_of(programs.mass, fields, cells, 8),
    )
    found = programs.spectrum(a, m, np.ones(len(a), bool))[:9]
    np.testing.assert_allclose(found, [0, 2, 2, 2, 6, 6, 6, 6, 6], rtol=4e-3, atol=1e-10)


# A periodic domain: nodes of opposite sides are one.


@fem.integrand
def carried(s: fem.Sample, u: fem.Field, v: fem.Field):
    flow = Vec2(REAL(1.0), REAL(0.5))
    return REAL(0.05) * wp.dot(fem.grad(u, s), fem.grad(v, s)) + wp.dot(flow, fem.grad(u, s)) * v(s)


@pytest.mark.parametrize(("name", "degree"), [("grid2", 2), ("tri", 3), ("quad", 2)])
def test_decay_of_a_periodic_wave(name, degree):
    """The growth of exp(2 pi i (x + y)) under transport and diffusion is its exact exponent."""

    def exponent(n):
        geometry = programs.warped_geometry(name, n)
        space = fem.make_polynomial_space(geometry, degree=degree, dtype=REAL)
        fields, cells = programs.fields_of(space), fem.Cells(geometry)
        a, m = (
            programs.matrix_of(carried, fields, cells, 8),
            programs.matrix_of(programs.mass, fields, cells, 8),
        )
        x = space.node_positions().numpy()
        places = np.round(np.where(x > 1.0 - 1e-9, 0.0, x), 9)
        _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
        tie = np.zeros((len(x), len(first)))
        tie[np.arange(len(x)), number.reshape(-1)] = 1.0
        a, m = tie.T @ a @ tie, tie.T @ m @ tie
        values = np.linalg.eigvals(np.linalg.solve(m, a))
        return values[np.abs(values - exact).argmin()]

    k = 2.0 * np.pi * np.array([1.0, 1.0])
    exact = 0.05 * (k @ k) + 1j * (k @ [1.0, 0.5])
    errors = [abs(exponent(4) - exact), abs(exponent(8) - exact)]
    assert programs.order_of(errors) > 2.0 * degree - 0.6


# Adaptive grids: interior penalties across levels.


@fem.integrand
def penalties(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    flux_u = wp.dot(fem.grad_average(u, s), n)
    flux_v = wp.dot(fem.grad_average(v, s), n)
    ju, jv = fem.jump(u, s), fem.jump(v, s)
    return REAL(80.0) * ju * jv - ju * flux_v - jv * flux_u


@fem.integrand
def nitsche(s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field):
    n = fem.normal(domain, s)
    flux_u, flux_v = wp.dot(fem.grad(u, s), n), wp.dot(fem.grad(v, s), n)
    return REAL(80.0) * u(s) * v(s) - u(s) * flux_v - v(s) * flux_u


@fem.integrand
def quadratic(s: fem.Sample, domain: fem.Domain):
    x = fem.position(domain, s)
    return x[0] * x[0] - REAL(2.0) * x[0] * x[1] + x[2] * (x[1] - REAL(1.0)) + REAL(0.5)


@fem.integrand
def nitsche_load(s: fem.Sample, domain: fem.Domain, v: fem.Field):
    n = fem.normal(domain, s)
    return quadratic(s, domain) * (REAL(80.0) * v(s) - wp.dot(fem.grad(v, s), n))


@fem.integrand
def constant_load(s: fem.Sample, v: fem.Field):
    return REAL(-2.0) * v(s)


@fem.integrand
def quadratic_error(s: fem.Sample, domain: fem.Domain, u: fem.Field):
    return (u(s) - quadratic(s, domain)) * (u(s) - quadratic(s, domain))


@pytest.mark.parametrize(
    "make",
    [
        programs.two_levels,
        lambda: programs.warped_geometry("hex", 2),
        lambda: programs.warped_geometry("grid3", 2),
    ],
)
def test_quadratic_solutions_across_levels(make):
    """Discontinuous quadratic elements give a quadratic solution to rounding, where cells of two
    sizes share sides, too."""
    geometry = make()
    cells, sides, border = fem.Cells(geometry), fem.Sides(geometry), fem.BoundarySides(geometry)
    space = fem.make_polynomial_space(geometry, degree=2, discontinuous=True, dtype=REAL)
    order = 8
    a = programs.matrix_of(programs.diffusion, programs.fields_of(space, cells), cells, order)
    a += programs.matrix_of(penalties, programs.fields_of(space, sides), sides, order)
    a += programs.matrix_of(nitsche, programs.fields_of(space, border), border, order)
    rule = fem.RegularQuadrature(cells, order=6)
    on_border = fem.RegularQuadrature(border, order=order)
    v = fem.make_test(space, domain=cells)
    b = fem.integrate(constant_load, quadrature=rule, fields={"v": v}).numpy()
    v = fem.make_test(space, domain=border)
    b = b + fem.integrate(nitsche_load, quadrature=on_border, fields={"v": v}).numpy()
    u = programs.field_of(space, np.linalg.solve(a, b))
    # Maps of warped cells take quadratic polynomials out of the space.
    limit = 2e-3 if "Hexmesh" in geometry.name else 1e-12
    assert programs.norm(quadratic_error, {"u": u}, 8, cells) < limit
    v = fem.make_test(space, domain=cells)
    volume = float(fem.integrate(one, quadrature=rule))
    assert volume == pytest.approx(1.0, abs=1e-13)


# Grids that do not conform: values pass between them.


@fem.integrand
def passed(s: fem.Sample, domain: fem.Domain, source: fem.Field, v: fem.Field):
    return source(s) * v(s)


@pytest.mark.parametrize(
    ("one_name", "other_name"), [("tri", "quad"), ("grid2", "tri"), ("tet", "grid3")]
)
def test_linear_fields_pass_between_grids(one_name, other_name):
    first, second = programs.warped_geometry(one_name, 3), programs.warped_geometry(other_name, 4)
    space = fem.make_polynomial_space(first, degree=1, dtype=REAL)
    x = space.node_positions().numpy()
    slopes = np.array([1.0, -2.0, 0.5][: x.shape[1]])
    field = programs.field_of(space, x @ slopes + 0.25)
    cells = fem.Cells(second)
    source = fem.NonconformingField(cells, field)
    target = fem.make_polynomial_space(second, degree=1, dtype=REAL)
    fields = programs.fields_of(target)
    m = programs.matrix_of(programs.mass, fields, cells, 4)
    rule = fem.RegularQuadrature(cells, order=4)
    b = fem.integrate(passed, quadrature=rule, fields={"source": source, "v": fields["v"]}).numpy()
    y = target.node_positions().numpy()
    # Maps of quadrilaterals are inverted to a few units in the last place.
    np.testing.assert_allclose(np.linalg.solve(m, b), y @ slopes + 0.25, atol=1e-11)


# Two materials: the flux through an interface is continuous, on cells chosen by a mask.


@fem.integrand
def conducted(s: fem.Sample, u: fem.Field, v: fem.Field, k: REAL):
    return k * wp.dot(fem.grad(u, s), fem.grad(v, s))


@pytest.mark.parametrize("name", ["grid2", "tri", "tet", "grid3"])
def test_two_materials(name):
    geometry = programs.geometry(name, 4, REAL)
    centers = fem.make_polynomial_space(geometry, degree=0, dtype=REAL).node_positions().numpy()
    space = fem.make_polynomial_space(geometry, degree=2, dtype=REAL)
    a = 0.0
    for k, chosen in ((1.0, centers[:, 0] < 0.5), (4.0, centers[:, 0] > 0.5)):
        mask = wp.array(chosen.astype(np.int32))
        part = fem.Subdomain(fem.Cells(geometry), element_mask=mask)
        a = a + programs.matrix_of(conducted, programs.fields_of(space, part), part, k=k)
    x = space.node_positions().numpy()[:, 0]
    exact = np.where(x < 0.5, 1.6 * x, 0.8 + 0.4 * (x - 0.5))
    fixed = (x < 1e-9) | (x > 1.0 - 1e-9)
    found = programs.solve(a, np.zeros(len(x)), fixed, exact)
    np.testing.assert_allclose(found, exact, atol=1e-12)


# Environments over subdomains, and partitions of test and trial functions that differ.


@fem.integrand
def conducted_by_environment(
    s: fem.Sample, domain: fem.Domain, u: fem.Field, v: fem.Field, k: wp.array(dtype=REAL)
):
    return k[fem.environment_index(domain, s)] * wp.dot(fem.grad(u, s), fem.grad(v, s))


def test_two_materials_in_each_environment():
    """The right half has another material in each copy of a grid; copies do not couple."""
    geometry = fem.Grid2D(wp.vec2i(4, 3), env_count=3, scalar_type=REAL)
    centers = fem.make_polynomial_space(geometry, degree=0, dtype=REAL).node_positions().numpy()
    space = fem.make_polynomial_space(geometry, degree=2, dtype=REAL)
    right, a = np.array([1.0, 4.0, 9.0]), 0.0
    for k, chosen in ((np.ones(3), centers[:, 0] < 0.5), (right, centers[:, 0] > 0.5)):
        mask, k = wp.array(chosen.astype(np.int32)), wp.array(k, dtype=REAL)
        part = fem.Subdomain(fem.Cells(geometry), element_mask=mask)
        fields = programs.fields_of(space, part)
        a = a + programs.matrix_of(conducted_by_environment, fields, part, k=k)
    x = space.node_positions().numpy()[:, 0]
    environment = np.repeat(np.arange(3), len(x) // 3)
    assert not a[environment[:, None] != environment].any()
    k = right[environment]
    flux = 2.0 / (1.0 + 1.0 / k)
    exact = np.where(x < 0.5, flux * x, flux * (0.5 + (x - 0.5) / k))
    fixed = (x < 1e-9) | (x > 1.0 - 1e-9)
    found = programs.solve(a, np.zeros(len(x)), fixed, exact)
    np.testing.assert_allclose(found, exact, atol=1e-12)


@pytest.mark.parametrize("name", ["tri", "hex"])
def test_partitions_of_test_and_trial_functions_differ(name):
    """A matrix over the cells of one part has the entries of all nodes that its two parts name."""
    geometry = programs.warped_geometry(name, 3)
    rng, n = np.random.default_rng(0), geometry.cell_count()
    masks = [wp.array(rng.integers(2, size=n).astype(np.int32)) for _ in range(2)]
    parts = [fem.ExplicitGeometryPartition(geometry, mask) for mask in masks]
    cells = fem.Cells(parts[0])
    spaces = [fem.make_polynomial_space(geometry, degree=k, dtype=REAL) for k in (2, 1)]

    def matrix(*partitions):
        v = fem.make_test(spaces[0], space_partition=partitions[0], domain=cells)
        u = fem.make_trial(spaces[1], space_partition=partitions[1], domain=cells)
        return programs.matrix_of(programs.mass, {"u": u, "v": v})

    some = [
        fem.make_space_partition(space.topology, part, with_halo=False)
        for space, part in zip(spaces, parts)
    ]
    every = [fem.make_space_partition(space.topology) for space in spaces]
    rows, columns = (partition.space_node_indices().numpy() for partition in some)
    expected = matrix(*every)
    assert len(columns) < expected.shape[1] and len(rows) < expected.shape[0]
    np.testing.assert_allclose(matrix(*some), expected[np.ix_(rows, columns)], atol=1e-16)
    measure = float(fem.integrate(one, quadrature=fem.RegularQuadrature(cells, order=6)))
    assert expected.sum() == pytest.approx(measure, rel=1e-12)
