"""Bad input of geometries: errors that name the cell, reports by number, never a fault."""

import warnings

import numpy as np
import pytest

import warp as wp
import warp.fem as fem
from box_meshes import box_mesh
from warp._src.fem.geometry import check

MESHES = {"triangle": fem.Trimesh2D, "square": fem.Quadmesh2D, "tet": fem.Tetmesh}
MESHES["cube"] = fem.Hexmesh


def make(cell, cells, positions, real=wp.float32):
    vector = wp.types.vector(positions.shape[1], real)
    return MESHES[cell](wp.array(cells, dtype=wp.int32), wp.array(positions, dtype=vector))


@pytest.mark.parametrize("cell", MESHES)
def test_vertices_out_of_range_are_named(cell):
    cells, positions = box_mesh(cell, 2)
    for bad in (-1, len(positions), 2**31 - 1, -(2**31)):
        broken = cells.copy()
        broken[3, 1] = bad
        n = len(positions)
        with pytest.raises(ValueError, match=rf"Vertex index {bad} of cell 3.*in \[0, {n}\)"):
            make(cell, broken, positions)


@pytest.mark.parametrize("cell", MESHES)
def test_an_empty_mesh_has_nothing(cell):
    cells, positions = box_mesh(cell, 1)
    for points in (positions, positions[:0]):
        mesh = make(cell, cells[:0], points)
        counts = (mesh.cell_count(), mesh.side_count(), mesh.boundary_side_count())
        assert counts == (0, 0, 0) and mesh.edge_count() == 0
        mesh.build_bvh()
        assert str(mesh.check()) == "no findings"
    with pytest.raises(ValueError, match=r"expected a value in \[0, 0\)"):
        make(cell, cells, positions[:0])


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("cell", MESHES)
def test_a_report_names_bad_cells(cell, real):
    cells, positions = box_mesh(cell, 3, 0.2, seed=2, shuffle=False)
    assert make(cell, cells, positions, real).check().is_fine
    positions = np.vstack((positions, np.zeros((10, positions.shape[1]))))
    extra = len(positions) - 10
    cells[1, 1] = cells[1, 0]
    cells[2] = cells[7]
    # A cell of its own vertices, with all of them on a line.
    k = cells.shape[1]
    cells[4] = np.arange(extra, extra + k)
    positions[cells[4]] = np.outer(np.arange(k), np.ones(positions.shape[1])) + 5.0
    report = make(cell, cells, positions, real).check()
    assert 1 in report.repeated_vertices and 7 in report.duplicates
    assert 4 in report.flat and not report.is_fine
    positions[extra + 1] = np.nan
    report = make(cell, cells, positions, real).check()
    assert 4 in report.not_finite and 4 not in report.flat
    assert f"{len(report.not_finite)} cells with NaN" in str(report)


def test_orientations():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    tables = {"up": (0, 1, 2, 3), "down": (0, 3, 2, 1), "bow tie": (0, 1, 3, 2)}
    dart = np.array([(0, 0), (1, 0), (0.2, 0.2), (0, 1)], float)
    for real in (wp.float32, wp.float64):
        reports = {
            name: make("square", [order], square, real).check() for name, order in tables.items()
        }
        assert reports["up"].is_fine and not len(reports["up"].inverted)
        assert reports["down"].is_fine and reports["down"].inverted.tolist() == [0]
        assert reports["bow tie"].folded.tolist() == [0]
        assert make("square", [(0, 1, 2, 3)], dart, real).check().folded.tolist() == [0]
        tet = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
        report = make("tet", [(0, 1, 2, 3), (0, 2, 1, 3)], tet, real).check()
        assert report.inverted.tolist() == [1] and report.duplicates.tolist() == [1]


def test_sides_of_three_cells_are_reported():
    points = np.array([(0, 0, 0), (0, 0, 1), (1, 0, 0), (0, 1, 0), (-1, -1, 0)], float)
    cells = np.array([(0, 1, 2), (0, 1, 3), (0, 1, 4)], np.int32)
    mesh = fem.Trimesh3D(wp.array(cells), wp.array(points, dtype=wp.vec3))
    assert len(mesh.check().crowded_sides) == 1


def test_arrays_of_the_wrong_type():
    cells, positions = box_mesh("tet", 1)
    points = wp.array(positions, dtype=wp.vec3)
    with pytest.raises(ValueError, match=r"'tet_vertex_indices' expects .* \(cells, 4\)"):
        fem.Tetmesh(wp.array(cells[:, :3]), points)
    with pytest.raises(ValueError, match="'tet_vertex_indices' expects .*int32"):
        fem.Tetmesh(wp.array(cells.astype(np.int64)), points)
    with pytest.raises(TypeError, match="'tet_vertex_indices' expects an array"):
        fem.Tetmesh(cells.tolist(), points)
    with pytest.raises(ValueError, match="'positions' expects .*vec3"):
        fem.Tetmesh(wp.array(cells), wp.array(positions[:, :2], dtype=wp.vec2))
    mesh = fem.Tetmesh(wp.array(cells), points)
    with pytest.raises(ValueError, match="'positions' expects 8 elements"):
        mesh.positions = points[:3]


def test_environments_of_cells():
    cells, positions = box_mesh("tet", 1)
    arrays = [wp.array(cells), wp.array(positions, dtype=wp.vec3)]
    n = len(cells)
    with pytest.raises(ValueError, match="'env_count' 3 expects 'cell_env'"):
        fem.Tetmesh(*arrays, env_count=3)
    with pytest.raises(ValueError, match="Environment count must be provided"):
        fem.Tetmesh(*arrays, cell_env=wp.zeros(n, dtype=int))
    with pytest.raises(ValueError, match=f"'cell_env' expects an array \\({n},\\)"):
        fem.Tetmesh(*arrays, cell_env=wp.zeros(n - 1, dtype=int), env_count=2)
    with pytest.raises(ValueError, match="cell 2 has 5"):
        bad = wp.array(np.array([0, 1, 5, 0, 0, 0], np.int32))
        fem.Tetmesh(*arrays, cell_env=bad, env_count=2)


@pytest.mark.parametrize("grid, counts", [(fem.Grid2D, wp.vec2i), (fem.Grid3D, wp.vec3i)])
def test_grids(grid, counts):
    d = len(counts(0))
    with pytest.raises(ValueError, match="'res' expects at least 1 cell"):
        grid(counts(*([3] * (d - 1) + [0])))
    with pytest.raises(ValueError, match="'bounds_hi' expects numbers above"):
        grid(counts(2), [0.0] * d, [1.0] * (d - 1) + [0.0])
    with pytest.raises(ValueError, match=f"'bounds_lo' expects {d} finite numbers"):
        grid(counts(2), [float("nan")] * d)
    with pytest.raises(ValueError, match="'env_count' expects at least 1"):
        grid(counts(2), env_count=0)
    with pytest.raises(ValueError, match="'res' expects below 2"):
        grid(counts(2**15 if d == 2 else 2**11))


def find_kernel(lookup, CellArg):
    @wp.kernel
    def find(arg: CellArg, x: wp.array(dtype=wp.vec3), cells: wp.array(dtype=int)):
        cells[wp.tid()] = lookup(arg, x[wp.tid()]).element_index

    return find


def test_lookup_of_nan_finds_nothing():
    cells, positions = box_mesh("tet", 2)
    mesh = fem.Tetmesh(wp.array(cells), wp.array(positions, dtype=wp.vec3), build_bvh=True)
    for geometry in (mesh, fem.Grid3D(wp.vec3i(2))):
        find = find_kernel(geometry.functions.cell_lookup, geometry.CellArg)
        bad = [(np.nan, 0, 0), (np.inf, 0, 0), (-3e38, 3e38, 0)]
        found = wp.zeros(3, dtype=int)
        wp.launch(
            find,
            3,
            [geometry.cell_arg_value(wp.get_device()), wp.array(bad, dtype=wp.vec3)],
            [found],
        )
        assert found.numpy()[0] == -1
        assert (found.numpy() < geometry.cell_count()).all()


def test_files(tmp_path):
    meshio = pytest.importorskip("meshio")
    cells, positions = box_mesh("cube", 2)
    blocks = [("hexahedron", cells), ("quad", cells[:2, :4])]
    meshio.write_points_cells(tmp_path / "box.vtk", np.vstack((positions, [[9, 9, 9]])), blocks)
    mesh = fem.read_mesh(tmp_path / "box.vtk", scalar_type=wp.float64)
    assert isinstance(mesh, fem.Hexmesh) and mesh.cell_count() == 8 and mesh.vertex_count() == 27
    assert mesh.check().is_fine
    surface = fem.read_mesh(tmp_path / "box.vtk", "quad")
    assert surface.cell_count() == 2
    with pytest.raises(ValueError, match="has no cells of triangle"):
        fem.read_mesh(tmp_path / "box.vtk", "triangle")


@fem.integrand
def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


def warnings_of(mesh):
    """Warnings of two integrations over a mesh."""
    space = fem.make_polynomial_space(mesh, degree=1, dtype=mesh.scalar_type)
    fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for _ in range(2):
            fem.integrate(mass, fields=fields)
    return [str(one.message) for one in caught]


@pytest.mark.parametrize("few", [0, 4096])
@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("cell", MESHES)
def test_the_first_integration_warns_of_bad_cells(cell, real, few, monkeypatch):
    """A warning names the kind of bad cells and the first of them, once for a mesh, also where
    bounds show that small meshes are fine."""
    monkeypatch.setattr(check, "_FEW_CELLS", few)
    cells, positions = box_mesh(cell, 3, 0.2, seed=2, shuffle=False)
    assert warnings_of(make(cell, cells, positions, real)) == []
    flipped = cells.copy()
    k = cells.shape[1]
    flipped[::2] = flipped[::2, [0, 2, 1] if k == 3 else list(range(k))]
    assert warnings_of(make(cell, flipped, positions, real)) == []
    dimension = positions.shape[1]
    positions = np.vstack((positions, np.outer(np.arange(k), np.ones(dimension)) + 5.0))
    cells[4] = np.arange(len(positions) - k, len(positions))
    (found,) = warnings_of(make(cell, cells, positions, real))
    assert "cells of measure 0 (1, the first is cell 4)" in found and "check()" in found
    positions[-1] = np.nan
    (found,) = warnings_of(make(cell, cells, positions, real))
    assert "cells with NaN or infinite positions (1, the first is cell 4)" in found


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
@pytest.mark.parametrize("cell", MESHES)
def test_bounds_never_hide_bad_cells(cell, real):
    """Meshes that bounds call fine have no cells to warn of, from regular to folded ones."""
    found = []
    for distortion in (0.0, 0.2, 0.5, 0.8, 1.5, 2.5):
        for stretch in (1.0, 1e-2, 1e-10):
            cells, positions = box_mesh(cell, 3, distortion, seed=3)
            positions = positions * np.append(np.ones(positions.shape[1] - 1), stretch)
            mesh = make(cell, cells, positions, real)
            found.append((check._are_surely_fine(mesh), mesh.check().is_fine))
    assert (True, False) not in found
    assert found[0] == (True, True) and (False, False) in found


@pytest.mark.parametrize("real", [wp.float32, wp.float64])
def test_slivers_lose_half_of_the_digits(real):
    """Four vertices near a plane: reported where their height is below the root of rounding."""
    root = 2.0**-11.5 if real is wp.float32 else 2.0**-26
    cells = [(0, 1, 2, 3), (4, 5, 6, 7)]
    for factor, expected in ((0.3, [1]), (3.0, [])):
        corner = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
        flat = corner + [2.0, 0.0, 0.0]
        flat[3] = (2.5, 0.5, factor * root * np.sqrt(0.5))
        mesh = make("tet", cells, np.vstack((corner, flat)), real)
        report = mesh.check()
        assert report.slivers.tolist() == expected and report.is_fine == (not expected)
        assert len(warnings_of(mesh)) == len(expected)


def test_a_dart_is_named_where_the_form_is_integrated():
    points = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (2, 0), (2, 1)], float)
    mesh = make("square", [(0, 1, 2, 3), (1, 4, 2, 5)], points)
    (found,) = warnings_of(mesh)
    assert "Quadmesh2D has cells that are not convex" in found and "first is cell 1)" in found
