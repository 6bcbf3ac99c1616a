"""Triangles without a mesh, against rational arithmetic."""

from fractions import Fraction
from itertools import permutations

import numpy as np

import warp as wp


@wp.kernel
def triangles(p: wp.array2d(dtype=wp.vec3), out: wp.array(dtype=int)):
    i = wp.tid()
    out[i] = wp.intersect_tri_tri(p[i, 0], p[i, 1], p[i, 2], p[i, 3], p[i, 4], p[i, 5])


@wp.kernel
def wide_triangles(p: wp.array2d(dtype=wp.vec3d), out: wp.array(dtype=int)):
    i = wp.tid()
    out[i] = wp.intersect_tri_tri(p[i, 0], p[i, 1], p[i, 2], p[i, 3], p[i, 4], p[i, 5])


def feasible(p):
    """True if two triangles share a point, in rational arithmetic: signs of volumes."""
    p = [[Fraction(float(x)) for x in corner] for corner in p]

    def side(a, b, c, d):
        u, v, w = ([y - x for x, y in zip(a, e, strict=True)] for e in (b, c, d))
        volume = (
            u[0] * (v[1] * w[2] - v[2] * w[1])
            - u[1] * (v[0] * w[2] - v[2] * w[0])
            + u[2] * (v[0] * w[1] - v[1] * w[0])
        )
        return (volume > 0) - (volume < 0)

    for first, second in permutations((p[:3], p[3:])):
        for n in range(3):
            a, b = first[n], first[(n + 1) % 3]
            ends = side(*second, a), side(*second, b)
            if ends == (0, 0):
                return None
            if ends[0] * ends[1] <= 0:
                around = [side(a, b, second[m], second[(m + 1) % 3]) for m in range(3)]
                if min(around) >= 0 or max(around) <= 0:
                    return True
    return False


def test_triangles_of_small_integers_meet_as_rationals_say(device):
    p = np.random.default_rng(3).integers(-4, 5, (1500, 6, 3))
    wanted = [feasible(q) for q in p]
    sure = np.array([w is not None for w in wanted])
    out = wp.zeros(len(p), dtype=int, device=device)
    given = wp.array(p.astype(np.float32), dtype=wp.vec3, device=device)
    wp.launch(triangles, dim=len(p), inputs=[given, out], device=device)
    wanted = np.array([bool(w) for w in wanted])
    assert (out.numpy()[sure] == wanted[sure]).all()
    assert 100 < wanted.sum() and sure.sum() > 1200


def test_triangles_that_nearly_touch_meet_as_rationals_say(device):
    """Corners are on planes and edges up to rounding, far from the origin."""
    rng = np.random.default_rng(6)
    p = rng.uniform(-1, 1, (1200, 6, 3)) + 100
    weights = rng.dirichlet(np.ones(3), 1200)
    weights[::2, 2] = 0
    weights /= weights.sum(1, keepdims=True)
    p[:, 3] = np.einsum("nc,ncx->nx", weights, p[:, :3])
    # The other corners are on one side, so that the one that nearly touches decides.
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    for n in (4, 5):
        height = np.einsum("nx,nx->n", p[:, n] - p[:, 0], normal)
        p[height < 0, n] = 2 * p[height < 0, 3] - p[height < 0, n]
    wanted = np.array([feasible(q) for q in p])
    assert 300 < wanted.sum() < 900
    out = wp.zeros(len(p), dtype=int, device=device)
    given = wp.array(p, dtype=wp.vec3d, device=device)
    wp.launch(wide_triangles, dim=len(p), inputs=[given, out], device=device)
    assert (out.numpy() == wanted).all()


def test_triangles_of_one_plane_and_touching_ones(device):
    a = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
    cases = [
        ([[1, 1, 0], [2, 1, 0], [1, 2, 0]], 1),  # within
        ([[-9, -9, 0], [30, -9, 0], [-9, 30, 0]], 1),  # around
        ([[2, 2, 0], [5, 5, 0], [6, 3, 0]], 1),  # a corner on an edge
        ([[3, 3, 0], [5, 5, 0], [6, 3, 0]], 0),
        ([[0, 0, 0], [0, 0, 4], [-4, 0, 4]], 1),  # a common corner
        ([[1, 1, 1], [2, 1, 1], [1, 2, 1]], 0),  # above
        ([[1, 1, 0], [1, 1, 3], [5, 5, 3]], 1),  # stands on it
    ]
    turned = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    for matrix in (np.eye(3), np.eye(3)[[2, 0, 1]], 1e-3 * np.round(64 * turned)):
        p = np.array([[*a, *b] for b, _ in cases]) @ matrix.T
        out = wp.zeros(len(p), dtype=int, device=device)
        given = wp.array(p.astype(np.float32), dtype=wp.vec3, device=device)
        if (p == p.astype(np.float32)).all():
            wp.launch(triangles, dim=len(p), inputs=[given, out], device=device)
            assert out.numpy().tolist() == [w for _, w in cases]
