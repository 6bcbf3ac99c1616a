"""Gradients of loops that keep what one iteration computed: the nearest, the largest, a hit."""

import numpy as np
import pytest

import warp as wp

REAL = wp.float64
rng = np.random.default_rng(11)
N, M = 9, 13


@wp.kernel
def polygon(p: wp.array2d(dtype=REAL), v: wp.array2d(dtype=REAL), out: wp.array(dtype=REAL)):
    """Signed distance; the other end of an edge is a carried integer."""
    i = wp.tid()
    q = wp.vec2d(p[i, 0], p[i, 1])
    d = REAL(1.0e10)
    s = REAL(1.0)
    j = v.shape[0] - 1
    for k in range(v.shape[0]):
        a = wp.vec2d(v[k, 0], v[k, 1])
        b = wp.vec2d(v[j, 0], v[j, 1])
        e = b - a
        w = q - a
        r = w - e * wp.clamp(wp.dot(w, e) / wp.dot(e, e), REAL(0.0), REAL(1.0))
        d = wp.min(d, wp.dot(r, r))
        up = e[0] * w[1] > e[1] * w[0]
        if (q[1] >= a[1] and q[1] < b[1] and up) or (q[1] < a[1] and q[1] >= b[1] and not up):
            s = -s
        j = k
    out[i] = s * wp.sqrt(d)


def polygon_values(p, v):
    out = np.zeros(len(p))
    for i, q in enumerate(p):
        d, s = 1e10, 1.0
        for k in range(len(v)):
            a, b = v[k], v[k - 1]
            e, w = b - a, q - a
            r = w - e * np.clip(w @ e / (e @ e), 0.0, 1.0)
            d = min(d, r @ r)
            up = e[0] * w[1] > e[1] * w[0]
            if (a[1] <= q[1] < b[1] and up) or (b[1] <= q[1] < a[1] and not up):
                s = -s
        out[i] = s * np.sqrt(d)
    return out


@wp.kernel
def nearest(p: wp.array2d(dtype=REAL), v: wp.array2d(dtype=REAL), out: wp.array(dtype=REAL)):
    """Several values of one iteration, under a condition that more is tested in."""
    i = wp.tid()
    best = REAL(4.0)
    hit = wp.vec2d(REAL(0.5), p[i, 1])
    which = int(-1)
    for k in range(v.shape[0]):
        at = wp.vec2d(v[k, 0], v[k, 1])
        d = wp.length(wp.vec2d(p[i, 0], p[i, 1]) - at)
        if k != i and d < best:
            best = d
            hit = at * d
            which = k
    out[i] = best * hit[0] + hit[1] * REAL(which)


def nearest_values(p, v):
    out = np.zeros(len(p))
    for i, q in enumerate(p):
        best, hit, which = 4.0, np.array([0.5, q[1]]), -1
        for k, at in enumerate(v):
            d = np.linalg.norm(q - at)
            if k != i and d < best:
                best, hit, which = d, at * d, k
        out[i] = best * hit[0] + hit[1] * which
    return out


@wp.kernel
def both_ends(p: wp.array2d(dtype=REAL), v: wp.array2d(dtype=REAL), out: wp.array(dtype=REAL)):
    """Two levels of loops, backwards; the largest of the smallest; a sum beside it."""
    i = wp.tid()
    low = REAL(100.0)
    high = REAL(-100.0)
    total = REAL(0.0)
    for row in range(4):
        least = REAL(50.0)
        for k in range(v.shape[0] - 1, row, -2):
            x = wp.sin(p[i, 0] * v[k, 1]) + v[k, 0] * p[i, 1] + REAL(row) * v[row, 0]
            least = wp.where(x < least, x, least)
            low = wp.min(x * x, low)
            total += x * least
        high = wp.max(high, least)
    out[i] = low * high + REAL(0.1) * total


def both_ends_values(p, v):
    out = np.zeros(len(p))
    for i, q in enumerate(p):
        low, high, total = 100.0, -100.0, 0.0
        for row in range(4):
            least = 50.0
            for k in range(len(v) - 1, row, -2):
                x = np.sin(q[0] * v[k, 1]) + v[k, 0] * q[1] + row * v[row, 0]
                least, low = min(x, least), min(x * x, low)
                total += x * least
            high = max(high, least)
        out[i] = low * high + 0.1 * total
    return out


VALUES = {polygon: polygon_values, nearest: nearest_values, both_ends: both_ends_values}
# A ring, so that edges do not cross.
ANGLES = np.sort(rng.uniform(0, 2 * np.pi, M))
V = np.stack([np.cos(ANGLES), np.sin(ANGLES)], 1) * rng.uniform(0.6, 1.4, (M, 1))
P, W = rng.uniform(-1.5, 1.5, (N, 2)), rng.normal(size=N)
P[0] = 30.0


CASES = [(kernel, M) for kernel in VALUES] + [(polygon, 0), (nearest, 0)]


@pytest.mark.parametrize(("kernel", "count"), CASES, ids=lambda one: getattr(one, "key", one))
def test_against_differences(kernel, count, device):
    v = V[:count]
    arrays = [
        wp.array(a, dtype=REAL, device=device, requires_grad=True, shape=a.shape) for a in (P, v)
    ]
    out = wp.zeros(N, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, N, [*arrays, out], device=device)
    tape.backward(grads={out: wp.array(W, dtype=REAL, device=device)})
    values = VALUES[kernel]
    np.testing.assert_allclose(out.numpy(), values(P, v), rtol=1e-13)
    step = 1e-6
    for which, one in enumerate(arrays):
        got, start = one.grad.numpy(), (P, v)[which]
        for at in np.ndindex(start.shape):
            pair = []
            for sign in (1, -1):
                moved = [P.copy(), v.copy()]
                moved[which][at] += sign * step
                pair.append(values(*moved) @ W)
            slope = (pair[0] - pair[1]) / (2 * step)
            assert got[at] == pytest.approx(slope, rel=1e-5, abs=1e-6)


def test_no_loop_is_reversed():
    for kernel in (polygon, nearest):
        metrics = wp.autograd.adjoint_metrics(kernel)
        assert metrics["tape_bytes"] == 0 and metrics["replay_loops"] == 0
    # The sum needs what its loop carries.
    assert wp.autograd.adjoint_metrics(both_ends)["tape_bytes"] > 0


def test_what_the_launch_overwrites(device):
    """The largest of a row is kept where the row is overwritten afterwards."""

    @wp.kernel
    def scale(x: wp.array2d(dtype=REAL)):
        i = wp.tid()
        high = REAL(0.0)
        for k in range(x.shape[1]):
            high = wp.max(high, x[i, k])
        for k in range(x.shape[1]):
            x[i, k] = x[i, k] / high

    start = rng.uniform(0.1, 1.0, (3, 5))
    weights = rng.normal(size=(3, 5))
    x = wp.array(start, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(scale, 3, [x], device=device)
    tape.backward(grads={x: wp.array(weights, dtype=REAL, device=device)})
    high = start.max(axis=1, keepdims=True)
    wanted = weights / high
    rows = np.arange(3)
    wanted[rows, start.argmax(axis=1)] -= (weights * start).sum(axis=1) / high[:, 0] ** 2
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-12)
