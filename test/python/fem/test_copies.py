"""Copies of finite elements that have assembled forms: caches stay behind."""

import copy
import pickle

import numpy as np
import pytest

import warp as wp
from warp import fem


@fem.integrand
def product(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def load(s: fem.Sample, v: fem.Field):
    return v(s)


@fem.integrand
def first(s: fem.Sample, domain: fem.Domain):
    return fem.position(domain, s)[0]


def grid():
    return fem.Grid2D(res=wp.vec2i(3, 4))


def triangles():
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=np.float32)
    cells = np.array([[0, 1, 2], [1, 3, 2]], dtype=np.int32)
    return fem.Trimesh2D(wp.array(cells, dtype=int), wp.array(corners, dtype=wp.vec2))


def moments(test):
    """Integrals of x and of 1 over a domain of area 1, by matrix and by linear form."""
    trial = fem.make_trial(test.space, domain=test.domain)
    field = test.space.make_field()
    fem.interpolate(first, dest=field)
    matrix = fem.integrate(product, fields={"u": trial, "v": test})
    vector = fem.integrate(load, fields={"v": test}).numpy()
    values = (matrix @ field.dof_values).numpy()
    return values.sum(), vector.sum()


COPIES = {"pickle": lambda one: pickle.loads(pickle.dumps(one)), "deepcopy": copy.deepcopy}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("make", [grid, triangles])
@pytest.mark.parametrize("degree", [1, 2])
def test_copies_of_what_was_assembled(make, degree, how, device):
    """Space, geometry and test function after matrices and vectors are still copied."""
    with wp.ScopedDevice(device):
        space = fem.make_polynomial_space(make(), degree=degree)
        test = fem.make_test(space, domain=fem.Cells(space.geometry))
        np.testing.assert_allclose(moments(test), (0.5, 1.0), rtol=1e-5)
        copied = COPIES[how]
        np.testing.assert_allclose(moments(copied(test)), (0.5, 1.0), rtol=1e-5)
        for one in (
            copied(space),
            fem.make_polynomial_space(copied(space.geometry), degree=degree),
        ):
            again = fem.make_test(one, domain=fem.Cells(one.geometry))
            np.testing.assert_allclose(moments(again), (0.5, 1.0), rtol=1e-5)


@pytest.mark.parametrize("how", COPIES)
def test_copies_of_partitions_that_were_assembled(how, device):
    """The halves of a grid are copied with their test functions."""
    with wp.ScopedDevice(device):
        geometry = grid()
        space = fem.make_polynomial_space(geometry, degree=1)
        total = 0.0
        for part in range(2):
            cells = fem.LinearGeometryPartition(geometry, part, 2)
            nodes = fem.make_space_partition(
                space_topology=space.topology, geometry_partition=cells
            )
            given = {"space_partition": nodes, "domain": fem.Cells(cells)}
            test, trial = fem.make_test(space, **given), fem.make_trial(space, **given)
            fem.integrate(product, fields={"u": trial, "v": test})
            total += fem.integrate(load, fields={"v": COPIES[how](test)}).numpy().sum()
        np.testing.assert_allclose(total, 1.0, rtol=1e-5)


@fem.integrand
def doubled(s: fem.Sample, domain: fem.Domain):
    return 2.0 * fem.position(domain, s)


@pytest.mark.parametrize("how", COPIES)
def test_copies_of_spaces_on_deformed_geometries(how, device):
    """The record of a space has the type of the field's argument, which is one in a process."""
    with wp.ScopedDevice(device):
        positions = fem.make_polynomial_space(grid(), dtype=wp.vec2).make_field()
        fem.interpolate(doubled, dest=positions)
        geometry = positions.make_deformed_geometry(relative=False)
        space = fem.make_polynomial_space(geometry, degree=1)
        test = fem.make_test(space, domain=fem.Cells(geometry))
        # A square of side 2: its area is 4, and the integral of x is 4.
        for one in (test, COPIES[how](test)):
            np.testing.assert_allclose(moments(one), (4.0, 4.0), rtol=1e-5)
