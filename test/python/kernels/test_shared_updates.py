"""Updates of elements that neighbouring threads share, in branches and loops left early.

On a GPU the lanes of a warp, or of each tile of 16 threads, add to such an element together. Sums
are compared with NumPy in float64, thread by thread.
"""

import numpy as np
import pytest

import warp as wp

SIZES = (1, 31, 32, 33, 96, 1000)


@wp.kernel
def layers(
    x: wp.array(dtype=float), c: wp.array(dtype=float), least: float, y: wp.array(dtype=float)
):
    i = wp.tid()
    s = float(0.0)
    light = float(1.0)
    for k in range(c.shape[0]):
        w = c[k] * wp.exp(-x[i] * float(k))
        if light * (1.0 - w) < least:
            break
        s += w * light
        light = light * (1.0 - w)
    y[i] = s


def layers_of(x, c, least):
    """Values of the kernel and their derivatives by x and by each of c, for all x."""
    k = np.arange(len(c))
    decay = np.exp(-np.outer(x, k))
    light, s, alive = np.ones_like(x), np.zeros_like(x), np.ones(len(x), bool)
    d_light, d_s = np.zeros((len(x), len(c) + 1)), np.zeros((len(x), len(c) + 1))
    for j in k:
        w = c[j] * decay[:, j]
        d_w = np.zeros_like(d_s)
        d_w[:, j], d_w[:, -1] = decay[:, j], -j * w
        alive &= light * (1.0 - w) >= least
        here = alive[:, None]
        d_s = np.where(here, d_s + d_w * light[:, None] + w[:, None] * d_light, d_s)
        s = np.where(alive, s + w * light, s)
        d_light = np.where(here, d_light * (1.0 - w)[:, None] - d_w * light[:, None], d_light)
        light = np.where(alive, light * (1.0 - w), light)
    return s, d_s


@pytest.mark.parametrize("least", [0.0, 0.05, 0.6, 2.0])
@pytest.mark.parametrize("n", SIZES)
def test_loops_left_early(device, n, least):
    rng = np.random.default_rng(n)
    x, c, seed = rng.uniform(0.01, 0.5, n), rng.uniform(0.1, 0.5, 40), rng.uniform(-1, 1, n)
    arrays = [wp.array(v, dtype=float, device=device, requires_grad=True) for v in (x, c)]
    y = wp.zeros(n, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(layers, n, [*arrays, least], [y], device=device)
    tape.backward(grads={y: wp.array(seed, dtype=float, device=device)})
    s, d = layers_of(x.astype(np.float32).astype(float), c.astype(np.float32).astype(float), least)
    assert np.allclose(y.numpy(), s, rtol=1e-5, atol=1e-6)
    seed = seed.astype(np.float32)
    assert np.allclose(arrays[0].grad.numpy(), seed * d[:, -1], rtol=2e-4, atol=1e-5)
    by_c = seed @ d[:, :-1]
    scale = np.abs(seed) @ np.abs(d[:, :-1])
    assert np.all(np.abs(arrays[1].grad.numpy() - by_c) <= 1e-5 * scale + 1e-6)


@wp.kernel
def blend(
    at: wp.array(dtype=wp.vec2),
    start: wp.array(dtype=int),
    order: wp.array(dtype=int),
    tiles: int,
    weight: wp.array(dtype=float),
    moment: wp.array(dtype=wp.vec3),
    hits: wp.array(dtype=int),
    nearest: wp.array(dtype=float),
):
    y, x = wp.tid()
    tile = (y // 16) * tiles + x // 16
    for k in range(start[tile], start[tile + 1]):
        g = order[k]
        d = wp.vec2(float(x), float(y)) - at[g]
        r = wp.length_sq(d)
        if r > 80.0:
            continue
        w = wp.exp(-0.02 * r)
        wp.atomic_add(weight, g, w)
        wp.atomic_add(moment, g, wp.vec3(d[0], d[1], w))
        wp.atomic_min(nearest, g, r)
        if w > 0.5:
            wp.atomic_add(hits, g, 1)


@pytest.mark.parametrize("shape", [(16, 16), (33, 47), (64, 96), (5, 200)])
def test_lists_of_tiles(device, shape):
    rng = np.random.default_rng(3)
    across = -(-shape[1] // 16)
    count, tiles = 30, across * -(-shape[0] // 16)
    at = rng.uniform(0, 1, (count, 2)) * [shape[1], shape[0]]
    lists = [rng.choice(count, rng.integers(0, 12), replace=False) for _ in range(tiles)]
    start = np.cumsum([0, *map(len, lists)])
    order = np.concatenate(lists)
    at = at.astype(np.float32)
    weight, moment, hits = np.zeros(count), np.zeros((count, 3)), np.zeros(count, int)
    nearest = np.full(count, 1e9)
    scale = np.zeros((count, 3))
    for y, x in np.ndindex(*shape):
        for g in lists[y // 16 * across + x // 16]:
            d = np.array([x, y]) - at[g].astype(float)
            r = d @ d
            assert abs(r - 80.0) > 1e-4
            if r < 80.0:
                w = np.exp(-0.02 * r)
                weight[g] += w
                moment[g] += [*d, w]
                scale[g] += np.abs([*d, w])
                nearest[g] = min(nearest[g], r)
                assert abs(w - 0.5) > 1e-6
                hits[g] += w > 0.5
    inputs = [wp.array(at, dtype=wp.vec2, device=device)]
    inputs += [wp.array(v, dtype=int, device=device) for v in (start, order)]
    outputs = [
        wp.zeros(count, dtype=float, device=device),
        wp.zeros(count, dtype=wp.vec3, device=device),
        wp.zeros(count, dtype=int, device=device),
        wp.full(count, 1e9, dtype=float, device=device),
    ]
    wp.launch(blend, shape, [*inputs, across], outputs, device=device)
    found = [one.numpy() for one in outputs]
    assert np.array_equal(found[2], hits)
    assert np.allclose(found[0], weight, rtol=1e-5, atol=0)
    assert np.all(np.abs(found[1] - moment) <= 1e-5 * scale)
    assert np.allclose(found[3], nearest, rtol=1e-5)


def kernel_for(dtype, scalar):
    @wp.kernel(module="unique")
    def some(
        x: wp.array(dtype=scalar),
        place: wp.array(dtype=int),
        total: wp.array(dtype=dtype),
        largest: wp.array(dtype=scalar),
    ):
        i = wp.tid()
        for k in range(place.shape[0]):
            v = x[i] * scalar(k + 1)
            if v > scalar(50):
                wp.atomic_add(total, place[k], dtype(v))
                if v > scalar(70):
                    wp.atomic_max(largest, place[k], v)

    return some


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64, wp.int32, wp.vec3d, wp.mat33f])
@pytest.mark.parametrize("n", SIZES)
def test_branches(device, n, dtype):
    scalar = getattr(dtype, "_wp_scalar_type_", dtype)
    rng = np.random.default_rng(n)
    x = rng.integers(0, 20, n)
    place = rng.permutation(11)
    v = np.outer(x, np.arange(11) + 1)
    total, largest = np.zeros(11), np.zeros(11)
    total[place] = np.where(v > 50, v, 0).sum(axis=0)
    largest[place] = np.where(v > 70, v, 0).max(axis=0)
    arrays = [
        wp.array(x, dtype=scalar, device=device),
        wp.array(place, dtype=int, device=device),
        wp.zeros(11, dtype=dtype, device=device),
        wp.zeros(11, dtype=scalar, device=device),
    ]
    wp.launch(kernel_for(dtype, scalar), n, arrays, device=device)
    found = arrays[2].numpy().reshape(11, -1)
    # Sums of whole numbers below 2^24 are exact.
    assert np.array_equal(found, np.repeat(total[:, None], found.shape[1], axis=1))
    assert np.array_equal(arrays[3].numpy(), largest)
