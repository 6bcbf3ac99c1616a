"""Triangles that share edges, and flips of edges against SciPy's rule of empty circles."""

from fractions import Fraction

import numpy as np
import pytest

import warp as wp
from warp.geometry import delaunay_edge_flip, tri_tri_adjacency


def fan_of(count, seed):
    """Points in the plane, triangulated row by row: far from Delaunay's."""
    random = np.random.default_rng(seed)
    side = int(count**0.5)
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side), indexing="ij"), axis=-1)
    places = places * [1.0, 3.0] + random.uniform(-0.3, 0.3, places.shape)
    faces = []
    for i in range(side - 1):
        for j in range(side - 1):
            a, b = i * side + j, (i + 1) * side + j
            faces += [[a, b, b + 1], [a, b + 1, a + 1]]
    return places.reshape(-1, 2).astype(np.float32), np.array(faces, dtype=np.int32)


def neighbours_by_hand(faces):
    shared = {}
    for t, face in enumerate(faces):
        for side in range(3):
            edge = frozenset((face[(side + 1) % 3], face[(side + 2) % 3]))
            shared.setdefault(edge, []).append((t, side))
    found = np.full(faces.shape, -1), np.full(faces.shape, -1)
    for pair in shared.values():
        if len(pair) == 2:
            for (t, side), other in (pair, pair[::-1]):
                found[0][t, side], found[1][t, side] = other
    return found


def is_in_circle(a, b, c, d):
    """Exactly."""
    rows = [
        [Fraction(float(x)) - Fraction(float(y)) for x, y in zip(p, d, strict=True)]
        for p in (a, b, c)
    ]
    (ax, ay), (bx, by), (cx, cy) = rows
    return (
        (ax * ax + ay * ay) * (bx * cy - cx * by)
        + (bx * bx + by * by) * (cx * ay - ax * cy)
        + (cx * cx + cy * cy) * (ax * by - bx * ay)
    ) > 0


def test_neighbours_across_edges(device):
    _, faces = fan_of(200, 0)
    faces = np.roll(faces[np.random.default_rng(1).permutation(len(faces))], 1, axis=1)
    neighbours, sides = tri_tri_adjacency(wp.array(faces, dtype=int, device=device))
    expected = neighbours_by_hand(faces)
    assert np.array_equal(neighbours.numpy(), expected[0])
    assert np.array_equal(sides.numpy(), expected[1])
    alone = tri_tri_adjacency(
        wp.array(faces, dtype=int, device=device), return_neighbor_edge_indices=False
    )
    assert np.array_equal(alone.numpy(), expected[0])


@pytest.mark.parametrize("seed", range(3))
def test_flips_end_with_empty_circles(device, seed):
    points, faces = fan_of(400, seed)
    indices = wp.array(faces, dtype=int, device=device)
    flips = delaunay_edge_flip(wp.array(points, dtype=wp.vec2, device=device), indices)
    assert int(flips.numpy()[0]) > 100
    after = indices.numpy()
    p = points.astype(np.float64)

    def areas(t):
        u, v = p[t[:, 1]] - p[t[:, 0]], p[t[:, 2]] - p[t[:, 0]]
        return (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) / 2

    assert (areas(after) > 0).all() and np.isclose(areas(after).sum(), areas(faces).sum())
    neighbours, sides = neighbours_by_hand(after)
    for t, side in np.argwhere(neighbours >= 0):
        apex = after[neighbours[t, side], sides[t, side]]
        if is_in_circle(*points[after[t]], points[apex]):
            # An edge stays only where its flip would turn a triangle over.
            a, b = after[t, (side + 1) % 3], after[t, (side + 2) % 3]
            c = after[t, side]
            assert min(areas(np.array([[c, a, apex], [c, apex, b]]))) <= 0


def test_points_on_a_circle_stay_as_they_are(device):
    points = wp.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=wp.vec2, device=device)
    indices = wp.array([[0, 1, 2], [0, 2, 3]], dtype=int, device=device)
    assert int(delaunay_edge_flip(points, indices).numpy()[0]) == 0


def test_empty_and_bad_input(device):
    none = wp.zeros((0, 3), dtype=int, device=device)
    points = wp.zeros(3, dtype=wp.vec2, device=device)
    assert len(tri_tri_adjacency(none)[0]) == 0
    assert int(delaunay_edge_flip(points, none).numpy()[0]) == 0
    with pytest.raises(ValueError, match=r"shape \(triangles, 3\)"):
        tri_tri_adjacency(wp.zeros(6, dtype=int, device=device))
    with pytest.raises(TypeError, match="of int32, but got int64"):
        tri_tri_adjacency(wp.zeros((2, 3), dtype=wp.int64, device=device))
    with pytest.raises(ValueError, match="max_passes >= 1"):
        delaunay_edge_flip(points, none, max_passes=0)
    with pytest.raises(ValueError, match="area_epsilon >= 0"):
        delaunay_edge_flip(points, none, area_epsilon=float("nan"))
