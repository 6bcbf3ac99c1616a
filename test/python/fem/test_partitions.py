"""Partitions, subdomains and environments: sums over parts are the whole, sides by sets."""

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from box_meshes import box_mesh


@fem.integrand
def weight(s: fem.Sample, domain: fem.Domain):
    x = domain(s)
    return 1.0 + x[0] * x[1]


def geometries():
    cells, positions = box_mesh("tet", 3, 0.2, seed=3)
    tets = fem.Tetmesh(wp.array(cells), wp.array(positions, dtype=wp.vec3))
    return [fem.Grid2D(wp.vec2i(3, 4)), fem.Grid3D(wp.vec3i(3, 2, 4)), tets]


def partitions(geometry):
    rng = np.random.default_rng(0)
    part = rng.integers(3, size=geometry.cell_count())
    masks = [wp.array((part == k).astype(np.int32)) for k in range(3)]
    yield part, [fem.ExplicitGeometryPartition(geometry, mask) for mask in masks]
    size = -(-geometry.cell_count() // 3)
    part = np.arange(geometry.cell_count()) // size
    yield part, [fem.LinearGeometryPartition(geometry, k, 3) for k in range(3)]


def elements(domain):
    """Numbers in the geometry of the elements of a domain."""
    IndexArg, index = domain.functions.ElementIndexArg, domain.functions.element_index

    @wp.kernel
    def read(arg: IndexArg, out: wp.array(dtype=int)):
        out[wp.tid()] = index(arg, wp.tid())

    out = wp.zeros(domain.element_count(), dtype=int)
    wp.launch(read, out.shape, [domain.element_index_arg_value(wp.get_device())], [out])
    return out.numpy()


def cells_beside(geometry):
    f = geometry.functions
    SideArg, inner, outer = f.SideArg, f.side_inner_cell_index, f.side_outer_cell_index

    @wp.kernel
    def read(arg: SideArg, out: wp.array(dtype=wp.vec2i)):
        out[wp.tid()] = wp.vec2i(inner(arg, wp.tid()), outer(arg, wp.tid()))

    out = wp.zeros(geometry.side_count(), dtype=wp.vec2i)
    wp.launch(read, out.shape, [geometry.side_arg_value(wp.get_device())], [out])
    return out.numpy()


@pytest.mark.parametrize("which", range(3))
def test_cells_and_sides_of_partitions(which):
    geometry = geometries()[which]
    inner, outer = cells_beside(geometry).T
    for part, parts in partitions(geometry):
        for k, one in enumerate(parts):
            np.testing.assert_array_equal(elements(fem.Cells(one)), np.flatnonzero(part == k))
            own = part[inner] == k
            np.testing.assert_array_equal(elements(fem.Sides(one)), np.flatnonzero(own))
            boundary = np.flatnonzero(own & (inner == outer))
            np.testing.assert_array_equal(elements(fem.BoundarySides(one)), boundary)
            frontier = np.flatnonzero(own != (part[outer] == k))
            np.testing.assert_array_equal(elements(fem.FrontierSides(one)), frontier)


@pytest.mark.parametrize("domain_of", [fem.Cells, fem.Sides, fem.BoundarySides])
@pytest.mark.parametrize("which", range(3))
def test_sums_over_partitions_are_the_whole(which, domain_of):
    geometry = geometries()[which]
    whole = fem.integrate(weight, quadrature=fem.RegularQuadrature(domain_of(geometry), 2))
    for _, parts in partitions(geometry):
        rules = [fem.RegularQuadrature(domain_of(one), 2) for one in parts]
        total = sum(fem.integrate(weight, quadrature=rule) for rule in rules)
        assert total == pytest.approx(whole, rel=3e-6)


def test_subdomains_select_elements():
    grid = fem.Grid2D(wp.vec2i(4, 4))
    mask = np.zeros(16, np.int32)
    mask[[2, 5, 11]] = 1
    by_mask = fem.Subdomain(fem.Cells(grid), element_mask=wp.array(mask))
    by_list = fem.Subdomain(fem.Cells(grid), element_indices=wp.array([2, 5, 11], dtype=int))
    for domain in (by_mask, by_list):
        np.testing.assert_array_equal(elements(domain), [2, 5, 11])
    with pytest.raises(ValueError, match=r"one of 'element_mask' and 'element_indices'"):
        fem.Subdomain(fem.Cells(grid))
    with pytest.raises(ValueError, match=r"'element_mask' expects shape \(16,\)"):
        fem.Subdomain(fem.Cells(grid), element_mask=wp.zeros(3, dtype=int))


def test_partitions_of_fixed_size_name_no_element_beyond():
    grid = fem.Grid2D(wp.vec2i(3, 3))
    mask = wp.array(np.arange(9, dtype=np.int32) % 2)
    part = fem.ExplicitGeometryPartition(grid, mask, max_cell_count=7, max_side_count=24)
    np.testing.assert_array_equal(elements(fem.Cells(part)), [1, 3, 5, 7, -1, -1, -1])
    assert part.side_count() == 24
    whole = fem.ExplicitGeometryPartition(grid, mask)
    sides = elements(fem.Sides(whole))
    np.testing.assert_array_equal(elements(fem.Sides(part))[: len(sides)], sides)
    with pytest.raises(ValueError, match="'cell_mask' expects an array"):
        part.rebuild(wp.zeros(4, dtype=int))


@pytest.mark.parametrize("which", [0, 1])
def test_environments_are_copies_apart(which):
    res, kind = [(wp.vec2i(2, 3), fem.Grid2D), (wp.vec3i(2, 3, 2), fem.Grid3D)][which]
    one, three = kind(res), kind(res, env_count=3)
    assert three.cell_count() == 3 * one.cell_count()
    single, several = cells_beside(one), cells_beside(three)
    expected = np.concatenate([single + k * one.cell_count() for k in range(3)])
    np.testing.assert_array_equal(several, expected)
