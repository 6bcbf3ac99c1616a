"""Edges without a mesh, against dense searches."""

import numpy as np

import warp as wp


@wp.kernel
def edges(p: wp.array2d(dtype=wp.vec3), epsilon: float, out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    out[i] = wp.closest_point_edge_edge(p[i, 0], p[i, 1], p[i, 2], p[i, 3], epsilon)


def run_edges(p, device, epsilon=1e-12, requires_grad=False):
    x = wp.array(p, dtype=wp.vec3, device=device, requires_grad=requires_grad)
    out = wp.zeros(len(p), dtype=wp.vec3, device=device, requires_grad=requires_grad)
    wp.launch(edges, dim=len(p), inputs=[x, epsilon, out], device=device)
    return x, out


def search(p):
    """The smallest distance, of all pairs of an interior and end points."""
    p1, q1, p2, q2 = (p[:, n].astype(np.float64) for n in range(4))
    best = np.full(len(p), np.inf)

    def to_segment(x, a, b):
        d = b - a
        t = np.clip(((x - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-300), 0, 1)
        return np.linalg.norm(a + t[:, None] * d - x, axis=1)

    for x, a, b in ((p1, p2, q2), (q1, p2, q2), (p2, p1, q1), (q2, p1, q1)):
        best = np.minimum(best, to_segment(x, a, b))
    u, v, w = q1 - p1, q2 - p2, p1 - p2
    n = np.cross(u, v)
    square = np.maximum((n * n).sum(1), 1e-300)
    s = (np.cross(v, w) * n).sum(1) / square
    t = (np.cross(u, w) * n).sum(1) / square
    crossing = np.abs((w * n).sum(1)) / np.sqrt(square)
    # An end of one of two parallel edges is among the closest points.
    skew = square > 1e-12 * (u * u).sum(1) * (v * v).sum(1) + 1e-290
    inside = skew & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    return np.where(inside, np.minimum(best, crossing), best)


def test_edges_are_as_close_as_any_pair_of_their_points(device):
    p = np.random.default_rng(0).uniform(-1, 1, (500, 4, 3)).astype(np.float32)
    p[:50, 3] = p[:50, 2] + 2.0 * (p[:50, 1] - p[:50, 0])
    p[50:60, 1] = p[50:60, 0]
    p[60:70, 3] = p[60:70, 2]
    found = run_edges(p, device)[1].numpy()
    assert np.abs(found[:, 2] - search(p)).max() < 1e-6
    wide = p.astype(np.float64)
    foot = wide[:, 0] + found[:, :1] * (wide[:, 1] - wide[:, 0])
    other = wide[:, 2] + found[:, 1:2] * (wide[:, 3] - wide[:, 2])
    assert np.abs(np.linalg.norm(foot - other, axis=1) - found[:, 2]).max() < 1e-6
    assert (found[50:60, 0] == 0).all() and (found[60:70, 1] == 0).all()


def test_distance_of_edges_has_a_derivative(device):
    p = np.random.default_rng(1).uniform(-1, 1, (100, 4, 3)).astype(np.float32)
    with wp.Tape() as tape:
        x, out = run_edges(p, device, requires_grad=True)
    seed = wp.array(np.tile([0, 0, 1], (100, 1)), dtype=wp.vec3, device=device)
    tape.backward(grads={out: seed})
    step = 1e-6
    turn = np.random.default_rng(2).standard_normal(p.shape)
    wide = p.astype(np.float64)
    difference = (search(wide + step * turn) - search(wide - step * turn)) / (2 * step)
    assert np.abs((x.grad.numpy() * turn).sum(axis=(1, 2)) - difference).max() < 1e-4
