"""Marching cubes: closed surfaces, their measures, every case, derivatives, what is refused."""

import numpy as np
import pytest

import warp as wp
import warp.geometry
from warp._src.geometry.surfaces import cases


def edges_of(faces):
    """Directed edges of triangles and their reverses, as sorted rows."""
    there = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(there, axis=0), np.unique(there[:, ::-1], axis=0), len(there)


def is_closed(faces):
    """Each edge is there once in each direction."""
    there, back, count = edges_of(faces)
    return len(there) == count and np.array_equal(there, back)


def volume_of(points, faces):
    a, b, c = (points[faces[:, n]].astype(np.float64) for n in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6


def ball(n, radius, device, requires_grad=False):
    x = np.stack(np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij"), axis=-1)
    values = np.linalg.norm(x, axis=-1) - radius
    return wp.array(values, dtype=float, device=device, requires_grad=requires_grad)


def test_table_has_closed_loops_for_all_cases():
    starts, triangles = cases.tables()
    assert len(starts) == 257 and len(triangles) == 820
    for case in range(256):
        crossed = {
            edge for edge, (a, b) in enumerate(cases.EDGES) if (case >> a & 1) != (case >> b & 1)
        }
        assert {*triangles[starts[case] : starts[case + 1]].ravel().tolist()} == crossed


def test_ball_is_closed_and_has_its_volume(device):
    surface = wp.MarchingCubes(33, 33, 33, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
    surface.surface(ball(33, 0.7, device), 0.0)
    points, faces = surface.verts.numpy(), surface.indices.numpy().reshape(-1, 3)
    assert is_closed(faces)
    assert len(points) - len(faces) * 3 // 2 + len(faces) == 2
    assert abs(volume_of(points, faces) / (4 / 3 * np.pi * 0.7**3) - 1) < 5e-3
    assert np.abs(np.linalg.norm(points, axis=1) - 0.7).max() < 1e-3


def test_public_tables_give_the_ball_as_well():
    """Corners whose value is not less than the threshold have their bit set."""
    kind = wp.MarchingCubes
    values = ball(17, 0.7, "cpu").numpy()
    corners, edges = np.array(kind.CUBE_CORNER_OFFSETS), np.array(kind.EDGE_TO_CORNERS)
    ranges, local = kind.CASE_TO_TRI_RANGE, np.array(kind.TRI_LOCAL_INDICES)
    faces = []
    for cell in np.ndindex(16, 16, 16):
        at = cell + corners
        case = sum(1 << n for n in range(8) if values[tuple(at[n])] >= 0.0)
        ends = at[edges[local[ranges[case] : ranges[case + 1]]]]
        v = values[tuple(np.moveaxis(ends, -1, 0))]
        place = ends[:, 0] + (v[:, 0] / (v[:, 0] - v[:, 1]))[:, None] * (ends[:, 1] - ends[:, 0])
        faces += place.reshape(-1, 3, 3).tolist()
    faces = np.array(faces)
    points, numbers = np.unique(faces.reshape(-1, 3), axis=0, return_inverse=True)
    assert is_closed(numbers.reshape(-1, 3))
    size = volume_of(points * 0.125 - 1.0, numbers.reshape(-1, 3))
    assert abs(size / (4 / 3 * np.pi * 0.7**3) - 1) < 0.03


def test_noise_gives_closed_surfaces_whatever_the_case(device):
    values = np.random.default_rng(0).standard_normal((14, 15, 16)).astype(np.float32)
    # No surface leaves the grid, and some values are the threshold.
    values[1:-1, 1:-1, 1:-1][::3, ::4, ::5] = 0.25
    for axis in range(3):
        for side in (0, -1):
            np.moveaxis(values, axis, 0)[side] = 1.0
    field = wp.array(values, dtype=float, device=device)
    vertices, indices = wp.geometry.IsoSurfaceMarchingCubes.extract(field, 0.25)
    faces = indices.numpy().reshape(-1, 3)
    assert is_closed(faces)
    assert np.array_equal(np.unique(faces), np.arange(len(vertices)))
    crossed = sum(
        np.count_nonzero(np.diff(values < np.float32(0.25), axis=axis)) for axis in range(3)
    )
    assert len(vertices) == crossed


def test_positions_follow_the_field(device):
    field = ball(9, 0.6, device, requires_grad=True)
    with wp.Tape() as tape:
        vertices, _ = wp.geometry.IsoSurfaceMarchingCubes.extract(field, 0.0)
    weights = np.random.default_rng(1).standard_normal((len(vertices), 3)).astype(np.float32)
    tape.backward(grads={vertices: wp.array(weights, dtype=wp.vec3, device=device)})
    found = field.grad.numpy()
    values = field.numpy().astype(np.float64)
    place = vertices.numpy()
    expected = np.zeros_like(values)
    for position, weight in zip(place, weights, strict=True):
        axis = int(np.argmax(np.abs(position - np.round(position)) > 1e-6))
        low = np.floor(position + 1e-6).astype(int)
        low = np.where(np.arange(3) == axis, np.floor(position), np.round(position)).astype(int)
        high = low + np.eye(3, dtype=int)[axis]
        f0, f1 = values[tuple(low)], values[tuple(high)]
        t = -f0 / (f1 - f0)
        expected[tuple(low)] += weight[axis] * (t - 1) / (f1 - f0)
        expected[tuple(high)] -= weight[axis] * t / (f1 - f0)
    assert np.abs(found - expected).max() < 2e-4 * np.abs(expected).max()


def test_extreme_values_and_no_surface(device):
    values = np.full((3, 3, 3), 3e38, dtype=np.float32)
    values[1, 1, 1] = -3e38
    vertices, indices = wp.geometry.IsoSurfaceMarchingCubes.extract(
        wp.array(values, dtype=float, device=device)
    )
    assert np.allclose(np.abs(vertices.numpy() - 1).sum(axis=1), 0.5)
    assert is_closed(indices.numpy().reshape(-1, 3))
    for nothing in (np.zeros((2, 2, 2)), np.full((2, 2, 2), np.nan)):
        vertices, indices = wp.geometry.IsoSurfaceMarchingCubes.extract(
            wp.array(nothing, dtype=float, device=device)
        )
        assert len(vertices) == 0 and len(indices) == 0


def test_what_is_refused():
    extract = wp.geometry.IsoSurfaceMarchingCubes.extract
    with pytest.raises(ValueError, match="3D"):
        extract(wp.zeros((4, 4), dtype=float, device="cpu"))
    with pytest.raises(ValueError, match="2 nodes"):
        extract(wp.zeros((4, 1, 4), dtype=float, device="cpu"))
    with pytest.raises(TypeError, match="float32"):
        extract(wp.zeros((4, 4, 4), dtype=wp.float64, device="cpu"))
    with pytest.raises(ValueError, match="shape"):
        wp.MarchingCubes(3, 3, 3).surface(wp.zeros((4, 4, 4), dtype=float, device="cpu"), 0.0)
    for name in ("lower", "upper"):
        both = {name: (0.0, 0.0, 0.0), f"domain_bounds_{name}_corner": (1.0, 1.0, 1.0)}
        with pytest.raises(TypeError, match=f"both `{name}` and `domain_bounds_{name}_corner`"):
            wp.MarchingCubes(4, 4, 4, **both)
    with pytest.raises(TypeError, match="abstract"):
        warp.geometry.IsoSurfaceBase(4, 4, 4)
