"""Sides and entities of meshes against sets of Python, positions from both cells of a side."""

import numpy as np
import pytest

import warp as wp
from box_meshes import EDGES, SIDES, box_mesh, entity_sets
from warp._src.fem.geometry.meshes import Hexmesh, Quadmesh, Tetmesh, Trimesh
from warp._src.fem.types import make_free_sample

MESHES = {"triangle": Trimesh, "square": Quadmesh, "tet": Tetmesh, "cube": Hexmesh}
ON_SIDE = {"triangle": (0.3, 0, 0), "square": (0.3, 0, 0), "tet": (0.2, 0.3, 0.5)}
ON_SIDE["cube"] = (0.3, 0.6, 0)
TOLERANCE = {wp.float32: 5e-6, wp.float64: 1e-14}
both_scalars = pytest.mark.parametrize("real", [wp.float32, wp.float64])


def make_mesh(cell, real, n=4, distortion=0.3):
    cells, positions = box_mesh(cell, n, distortion, seed=1)
    vector = wp.types.vector(positions.shape[1], real)
    return MESHES[cell](wp.array(cells), wp.array(positions, dtype=vector)), cells, positions


@pytest.mark.parametrize("cell", MESHES)
def test_sides_and_edges_are_the_sets_of_their_vertices(cell):
    mesh, cells, _ = make_mesh(cell, wp.float32)
    expected = entity_sets(cells, SIDES[cell])
    assert mesh.side_count() == len(expected)
    assert mesh.boundary_side_count() == sum(len(c) == 1 for c in expected.values())
    vertices, beside = mesh._sides.vertices.numpy(), mesh._sides.cells.numpy()
    for vertex_list, pair in zip(vertices.tolist(), beside.tolist()):
        owners = expected[frozenset(vertex_list)]
        assert pair == [min(owners), max(owners)]
    boundary = mesh._sides.boundary.numpy()
    np.testing.assert_array_equal(boundary, np.flatnonzero(beside[:, 0] == beside[:, 1]))
    if cell in EDGES:
        assert mesh.edge_count() == len(entity_sets(cells, EDGES[cell]))


@pytest.mark.parametrize("cell", MESHES)
def test_entities_of_cells_name_vertices_of_the_cell(cell):
    mesh, _, _ = make_mesh(cell, wp.float32)
    entities = mesh.entities()
    cells = entities.cells.numpy()
    tables = [(entities.cell_edges, entities.edge_vertices, mesh.cell.edges)]
    if entities.faces:
        tables.append((entities.cell_faces, entities.face_vertices, mesh.cell.faces))
    for of_cells, vertices, places in tables:
        found = np.sort(vertices.numpy()[of_cells.numpy()], axis=2)
        np.testing.assert_array_equal(found, np.sort(cells[:, np.array(places)], axis=2))
        assert (vertices.numpy()[:, 0] == vertices.numpy().min(axis=1)).all()


@both_scalars
@pytest.mark.parametrize("cell", MESHES)
def test_points_of_a_side_are_those_of_both_cells(cell, real):
    mesh, cells, positions = make_mesh(cell, real)
    f, vector = mesh.functions, wp.types.vector(positions.shape[1], real)
    on_side = mesh.coords_type(*ON_SIDE[cell])

    @wp.kernel
    def compare(
        arg: f.SideArg,
        errors: wp.array(dtype=real),
        points: wp.array(dtype=vector),
        normals: wp.array(dtype=vector),
    ):
        i = wp.tid()
        s = make_free_sample(i, on_side)
        x = f.side_position(arg, s)
        inner = f.side_inner_sample(arg, s)
        outer = f.side_outer_sample(arg, s)
        error = wp.length(f.cell_position(arg.cell_arg, inner) - x)
        error += wp.length(f.cell_position(arg.cell_arg, outer) - x)
        back = f.side_from_cell_coords(arg, i, inner.element_index, inner.element_coords)
        error += wp.length(back - on_side)
        back = f.side_from_cell_coords(arg, i, outer.element_index, outer.element_coords)
        error += wp.length(back - on_side)
        error += wp.length(f.side_coordinates(arg, i, x) - on_side)
        coords = f.cell_coordinates(arg.cell_arg, inner.element_index, x)
        errors[i] = error + wp.length(coords - inner.element_coords)
        points[i] = x
        normals[i] = f.side_normal(arg, s)

    n = mesh.side_count()
    errors = wp.zeros(n, dtype=real)
    points, normals = wp.zeros(n, dtype=vector), wp.zeros(n, dtype=vector)
    wp.launch(compare, n, [mesh.side_arg_value()], [errors, points, normals])
    assert errors.numpy().max() < TOLERANCE[real]
    inner = mesh._sides.cells.numpy()[:, 0]
    outward = points.numpy() - positions[cells].mean(axis=1)[inner]
    assert (np.sum(outward * normals.numpy(), axis=1) > 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(normals.numpy(), axis=1), 1.0, rtol=1e-6)


@pytest.mark.parametrize("cell", MESHES)
def test_gradients_keep_their_bits_under_translation_and_scaling(cell):
    cells, positions = box_mesh(cell, 4, 0.0, seed=1)
    # Multiples of 1/16, so that a shift by 2^10 cells is exact in float32.
    positions = np.round(16 * (positions + np.sin(9.0 * positions) / 40)) / 16
    n, d = len(cells), positions.shape[1]

    def gradients(scale, shift):
        vector = wp.types.vector(d, wp.float32)
        array = wp.array(scale * (positions + shift), dtype=vector)
        mesh = MESHES[cell](wp.array(cells), array)
        gradient, CellArg = mesh.functions.cell_deformation_gradient, mesh.CellArg
        at = mesh.coords_type(0.25, 0.5, 0.25)

        @wp.kernel
        def read(arg: CellArg, out: wp.array(dtype=wp.types.matrix((d, d), wp.float32))):
            out[wp.tid()] = gradient(arg, make_free_sample(wp.tid(), at))

        out = wp.zeros(n, dtype=wp.types.matrix((d, d), wp.float32))
        wp.launch(read, n, [mesh.cell_arg_value(wp.get_device())], [out])
        return out.numpy()

    expected = gradients(1.0, 0.0)
    np.testing.assert_array_equal(gradients(1.0, 1024.0), expected)
    np.testing.assert_array_equal(gradients(2.0**-20, 0.0), 2.0**-20 * expected)
