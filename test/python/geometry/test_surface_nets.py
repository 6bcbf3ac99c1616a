"""Surface nets: closed surfaces, their measures, sheets apart, derivatives, what is refused."""

import numpy as np
import pytest

import warp as wp

extract = wp.geometry.IsoSurfaceNets.extract


def ball(n, radius, device, requires_grad=False):
    x = np.stack(np.meshgrid(*[np.linspace(-1, 1, n)] * 3, indexing="ij"), axis=-1)
    values = np.linalg.norm(x, axis=-1) - radius
    return wp.array(values, dtype=float, device=device, requires_grad=requires_grad)


def directed_edges(faces):
    return np.concatenate([faces[:, [n, (n + 1) % faces.shape[1]]] for n in range(faces.shape[1])])


def is_balanced(faces):
    """Each edge is there as often in one direction as in the other."""
    edges = directed_edges(faces)
    there = edges[np.lexsort(edges.T)]
    back = edges[:, ::-1]
    return np.array_equal(there, back[np.lexsort(back.T)])


def test_ball_is_closed_and_has_its_volume(device):
    for topology, corners in (("triangle", 3), ("quad", 4)):
        surface = wp.geometry.IsoSurfaceNets(
            33, 33, 33, lower=(-1.0, -1.0, -1.0), upper=(1.0, 1.0, 1.0), topology=topology
        )
        surface.surface(ball(33, 0.7, device), 0.0)
        points, faces = surface.verts.numpy(), surface.indices.numpy().reshape(-1, corners)
        assert is_balanced(faces)
        assert len(np.unique(directed_edges(faces), axis=0)) == faces.size
        assert len(points) - faces.size // 2 + len(faces) == 2
        a, b, c = (points[faces[:, n]].astype(float) for n in range(3))
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
        if corners == 4:
            d = points[faces[:, 3]].astype(float)
            volume += np.einsum("ij,ij->i", a, np.cross(c, d)).sum() / 6
        assert abs(volume / (4 / 3 * np.pi * 0.7**3) - 1) < 2e-2
        # Means of points on the ball are inside, by the square of a cell over the radius.
        assert np.abs(np.linalg.norm(points, axis=1) - 0.7).max() < (2 / 32) ** 2 / 0.7


def test_noise_gives_balanced_surfaces_whatever_the_case(device):
    values = np.random.default_rng(0).standard_normal((14, 15, 16)).astype(np.float32)
    values[1:-1, 1:-1, 1:-1][::3, ::4, ::5] = 0.25
    for axis in range(3):
        for side in (0, -1):
            np.moveaxis(values, axis, 0)[side] = 1.0
    field = wp.array(values, dtype=float, device=device)
    vertices, indices = extract(field, 0.25, topology="quad")
    faces = indices.numpy().reshape(-1, 4)
    assert is_balanced(faces)
    assert np.array_equal(np.unique(faces), np.arange(len(vertices)))
    inside = values < np.float32(0.25)
    assert len(faces) == sum(np.count_nonzero(np.diff(inside, axis=n)) for n in range(3))
    # A vertex is in the cell of its sheet, and no face has a vertex twice.
    assert (np.diff(np.sort(faces, axis=1), axis=1) > 0).all()


def test_sheets_of_a_cell_have_vertices_of_their_own(device):
    values = np.ones((4, 4, 4), dtype=np.float32)
    values[1, 1, 1] = values[2, 2, 2] = -1.0
    vertices, indices = extract(wp.array(values, dtype=float, device=device), topology="quad")
    faces = indices.numpy().reshape(-1, 4)
    assert len(vertices) == 16 and len(faces) == 12
    first = np.unique(faces[np.isin(faces, faces[0]).any(1)])
    # Two cubes of half the edge, around the two nodes.
    places = np.unique(np.round(vertices.numpy(), 4), axis=0)
    assert first.size == 8 and len(places) == 16


def test_positions_follow_the_field(device):
    field = ball(8, 0.6, device, requires_grad=True)
    with wp.Tape() as tape:
        vertices, _ = extract(field, 0.0)
    weights = np.random.default_rng(1).standard_normal((len(vertices), 3)).astype(np.float32)
    tape.backward(grads={vertices: wp.array(weights, dtype=wp.vec3, device=device)})
    values = field.numpy().astype(np.float64)
    cells = np.floor(vertices.numpy()).astype(int)

    expected = np.zeros_like(values)
    for cell, weight in zip(cells, weights, strict=True):
        crossings = []
        for axis in range(3):
            for place in np.ndindex(2, 2):
                low = tuple(cell + np.insert(place, axis, 0))
                high = tuple(cell + np.insert(place, axis, 1))
                if (values[low] < 0) != (values[high] < 0):
                    crossings.append((axis, low, high))
        # t = f0 / (f0 - f1), and the vertex is the mean of the crossings.
        for axis, low, high in crossings:
            slope = values[high] - values[low]
            t = -values[low] / slope
            expected[low] += weight[axis] * (t - 1) / slope / len(crossings)
            expected[high] -= weight[axis] * t / slope / len(crossings)
    assert np.count_nonzero(expected) > 70
    assert np.abs(field.grad.numpy() - expected).max() < 2e-4 * np.abs(expected).max()


def test_extremes_and_what_is_refused(device):
    values = np.full((3, 3, 3), 3e38, dtype=np.float32)
    values[1, 1, 1] = -3e38
    vertices, indices = extract(wp.array(values, dtype=float, device=device))
    # Each corner of the middle is the mean of three places half an edge away.
    assert np.allclose(np.abs(vertices.numpy() - 1), 1 / 6)
    assert is_balanced(indices.numpy().reshape(-1, 3)) and len(indices) == 36
    for nothing in (np.zeros((2, 2, 2)), np.full((2, 2, 2), np.nan)):
        vertices, indices = extract(wp.array(nothing, dtype=float, device=device))
        assert len(vertices) == 0 and len(indices) == 0
    with pytest.raises(ValueError, match="'triangle' or 'quad'"):
        wp.geometry.IsoSurfaceNets(3, 3, 3, topology="hexagon")
    with pytest.raises(ValueError, match="3D"):
        extract(wp.zeros((4, 4), dtype=float, device="cpu"))
    with pytest.raises(ValueError, match="shape"):
        wp.geometry.IsoSurfaceNets(3, 3, 3).surface(
            wp.zeros((4, 4, 4), dtype=float, device="cpu"), 0.0
        )


def test_vertices_are_corners_of_faces(device):
    """Sheets that cross edges on the border alone have no vertex, those beside them keep theirs."""
    values = np.ones((2, 2, 2), dtype=np.float32)
    values[0, 0, 0] = -1.0
    for topology in ("triangle", "quad"):
        vertices, indices = extract(wp.array(values, device=device), topology=topology)
        assert vertices.shape == indices.shape == (0,)
    # One cell has a sheet around the corner of the grid, and one around the edge inside.
    values = np.ones((3, 3, 2), dtype=np.float32)
    values[0, 0, 0] = values[1, 1, 1] = -1.0
    vertices, indices = extract(wp.array(values, device=device), topology="quad")
    assert sorted(indices.numpy()) == [0, 1, 2, 3]
    # Three crossings of a cell each: at 0.5 on one edge, and at the node inside on two.
    signs = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)])
    expected = np.column_stack([1 + signs / 6, np.full(4, 1 - 1 / 6)])
    found = vertices.numpy()
    np.testing.assert_allclose(found[np.lexsort(found.T[::-1])], expected, atol=1e-6)
