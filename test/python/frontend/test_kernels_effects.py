"""Atomics, random numbers and printing."""

import numpy as np
import pytest

import programs
import warp as wp


@pytest.mark.parametrize(
    "dtype", [wp.int32, wp.uint32, wp.int64, wp.uint64, wp.float32, wp.float64]
)
def test_contended_atomics(device, dtype):
    @wp.kernel
    def kernel(
        x: wp.array(dtype=dtype),
        total: wp.array(dtype=dtype),
        left: wp.array(dtype=dtype),
        low: wp.array(dtype=dtype),
        high: wp.array(dtype=dtype),
    ):
        i = wp.tid()
        wp.atomic_add(total, 0, x[i])
        wp.atomic_sub(left, 0, x[i])
        wp.atomic_min(low, 0, x[i])
        wp.atomic_max(high, 0, x[i])

    n = 50000
    data = np.random.default_rng(5).integers(3, 200, n)
    x = wp.array(data.astype(wp.dtype_to_numpy(dtype)), dtype=dtype, device=device)
    cells = [wp.full(1, v, dtype=dtype, device=device) for v in (0, 16_000_000, 100, 100)]
    wp.launch(kernel, n, [x], cells, device=device)
    total, left, low, high = (cell.numpy()[0] for cell in cells)
    assert (total, left) == (data.sum(), 16_000_000 - data.sum())
    assert (low, high) == (3, 199)


def test_atomic_returns_the_old_value(device):
    @wp.kernel
    def kernel(counter: wp.array(dtype=int), slot: wp.array(dtype=int)):
        i = wp.tid()
        if i % 3 == 0:
            k = wp.atomic_add(counter, 0, 1)
            slot[k] = i

    n = 30000
    counter = wp.zeros(1, dtype=int, device=device)
    slot = wp.full(n, -1, dtype=int, device=device)
    wp.launch(kernel, n, [counter, slot], device=device)
    assert counter.numpy()[0] == n // 3
    assert sorted(slot.numpy()[: n // 3].tolist()) == list(range(0, n, 3))
    assert (slot.numpy()[n // 3 :] == -1).all()


def test_composite_and_indexed_atomics(device):
    @wp.kernel
    def kernel(v: wp.array2d(dtype=wp.vec3), m: wp.array(dtype=wp.mat22)):
        i = wp.tid()
        wp.atomic_add(v, i % 2, i % 3, wp.vec3(1.0, 2.0, -1.0))
        wp.atomic_sub(m, 0, wp.mat22(1.0, 0.0, 2.0, 0.0))

    n = 6000
    v = wp.zeros((2, 3), dtype=wp.vec3, device=device)
    m = wp.zeros(1, dtype=wp.mat22, device=device)
    wp.launch(kernel, n, [v, m], device=device)
    assert (v.numpy() == np.array([1000.0, 2000.0, -1000.0])).all()
    assert m.numpy()[0].tolist() == [[-n, 0], [-2 * n, 0]]


def pcg(state):
    """The PCG hash of Jarzynski and Olano, JCGT 9(3), 2020, on uint32 arrays."""
    with np.errstate(over="ignore"):
        b = state * np.uint32(747796405) + np.uint32(2891336453)
        c = ((b >> ((b >> np.uint32(28)) + np.uint32(4))) ^ b) * np.uint32(277803737)
    return (c >> np.uint32(22)) ^ c


def test_random_numbers_follow_the_published_generator(device):
    @wp.kernel
    def kernel(
        seed: int,
        i0: wp.array(dtype=int),
        i1: wp.array(dtype=int),
        f0: wp.array(dtype=float),
        f1: wp.array(dtype=float),
        u0: wp.array(dtype=wp.uint32),
        g0: wp.array(dtype=float),
    ):
        i = wp.tid()
        state = wp.rand_init(seed, i)
        i0[i] = wp.randi(state)
        i1[i] = wp.randi(state, -5, 20)
        f0[i] = wp.randf(state)
        f1[i] = wp.randf(state, -2.0, 3.0)
        u0[i] = wp.randu(state)
        g0[i] = wp.randn(state)

    n, seed = 5000, 42
    types = [int, int, float, float, wp.uint32, float]
    outputs = [wp.zeros(n, dtype=t, device=device) for t in types]
    wp.launch(kernel, n, [seed], outputs, device=device)
    i0, i1, f0, f1, u0, g0 = (o.numpy() for o in outputs)

    def unit(state):
        return (state >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24)

    with np.errstate(over="ignore"):
        state = pcg(np.uint32(seed) + pcg(np.arange(n, dtype=np.uint32)))
    state = pcg(state)
    np.testing.assert_array_equal(i0, state.astype(np.int32))
    state = pcg(state)
    np.testing.assert_array_equal(i1, (state % np.uint32(25)).astype(np.int32) - 5)
    state = pcg(state)
    np.testing.assert_array_equal(f0, unit(state))
    state = pcg(state)
    np.testing.assert_allclose(f1, unit(state) * np.float64(5.0) - 2.0, atol=5e-7)
    state = pcg(state)
    np.testing.assert_array_equal(u0, state)
    first = pcg(state)
    radius = np.sqrt(-2.0 * np.log(unit(first).astype(np.float64) + 5.96e-8))
    turn = np.cos(2.0 * np.pi * unit(pcg(first)).astype(np.float64))
    np.testing.assert_allclose(g0, radius * turn, atol=3e-6)


def test_random_moments(device):
    @wp.kernel
    def kernel(g: wp.array(dtype=float)):
        i = wp.tid()
        state = wp.rand_init(7, i)
        g[i] = wp.randn(state)

    n = 200000
    g = wp.zeros(n, dtype=float, device=device)
    wp.launch(kernel, n, [g], device=device)
    values = g.numpy().astype(np.float64)
    assert abs(values.mean()) < 5 / n**0.5
    assert abs(values.var() - 1.0) < 5 * (2 / n) ** 0.5


PRINTING = """
import warp as wp
wp.config.quiet = True
wp.init()

@wp.kernel
def speak(x: wp.array(dtype=float)):
    i = wp.tid()
    wp.printf("i=%d x=%.3f %s\\n", i, x[i], "end")
    print(x[i])
    print(wp.vec3(1.0, 2.0, 3.0))
    print(i == 0)
    print("words")

x = wp.array([1.5], dtype=float, device="{device}")
wp.launch(speak, 1, [x], device="{device}")
wp.synchronize()
"""


def test_printing_goes_to_standard_output(device):
    status, out, err = programs.run(programs.write_program(PRINTING, device=device))
    assert status == 0, err
    lines = [line.strip() for line in out.splitlines()]
    assert lines == ["i=0 x=1.500 end", "1.5", "1 2 3", "True", "words"]


@pytest.mark.parametrize("dtype", [wp.int32, wp.uint64, wp.float32, wp.float64])
def test_lower_bound(device, dtype):
    @wp.kernel
    def kernel(x: wp.array(dtype=dtype), values: wp.array(dtype=dtype), out: wp.array2d(dtype=int)):
        i = wp.tid()
        out[i, 0] = wp.lower_bound(x, values[i])
        out[i, 1] = wp.lower_bound(x, 2, 5, values[i])

    data = np.array([1, 3, 3, 5, 7, 7, 11])
    wanted = np.arange(14)
    x = wp.array(data, dtype=dtype, device=device)
    values = wp.array(wanted, dtype=dtype, device=device)
    out = wp.zeros((14, 2), dtype=int, device=device)
    wp.launch(kernel, 14, [x, values, out], device=device)
    whole = np.minimum(np.searchsorted(data, wanted), len(data) - 1)
    part = np.clip(np.searchsorted(data, wanted), 2, 4)
    np.testing.assert_array_equal(out.numpy(), np.stack([whole, part], axis=1))


SAMPLES = {
    "unit_ring": 2,
    "unit_disk": 2,
    "unit_square": 2,
    "triangle": 2,
    "unit_cube": 3,
    "unit_sphere": 3,
    "unit_sphere_surface": 3,
    "unit_hemisphere": 3,
    "unit_hemisphere_surface": 3,
}


def sampled(name, draws):
    """Points of a shape from uniform numbers in [0, 1), in the order they are drawn."""
    a, b, c = (draw.astype(np.float64) for draw in draws)
    if name in ("unit_square", "unit_cube"):
        return np.stack([a, b, c], axis=1)[:, : SAMPLES[name]] - 0.5
    if name == "triangle":
        return np.stack([1.0 - np.sqrt(a), b * np.sqrt(a)], axis=1)
    if name in ("unit_ring", "unit_disk"):
        radius, turn = (1.0, a) if name == "unit_ring" else (np.sqrt(a), b)
        return (radius * np.array([np.cos(2 * np.pi * turn), np.sin(2 * np.pi * turn)])).T
    z = 1.0 - (1.0 if "hemi" in name else 2.0) * a
    radius = 1.0 if "surface" in name else np.cbrt(c)
    flat = np.sqrt(1.0 - z * z)
    turn = 2 * np.pi * b
    return (radius * np.array([np.cos(turn) * flat, np.sin(turn) * flat, z])).T


@pytest.mark.parametrize("name", SAMPLES)
def test_random_points(device, name):
    function = getattr(wp, "sample_" + name)
    dtype = wp.types.vector(SAMPLES[name], float)

    @wp.kernel
    def kernel(points: wp.array(dtype=dtype), states: wp.array(dtype=wp.uint32)):
        i = wp.tid()
        state = wp.rand_init(7, i)
        points[i] = function(state)
        states[i] = state

    n = 4000
    points = wp.zeros(n, dtype=dtype, device=device)
    states = wp.zeros(n, dtype=wp.uint32, device=device)
    wp.launch(kernel, n, [points, states], device=device)

    with np.errstate(over="ignore"):
        state = pcg(np.uint32(7) + pcg(np.arange(n, dtype=np.uint32)))
    chain = [state]
    for _ in range(3):
        chain.append(pcg(chain[-1]))
    draws = [(s >> np.uint32(8)).astype(np.float32) * np.float32(2.0**-24) for s in chain[1:]]
    np.testing.assert_allclose(points.numpy(), sampled(name, draws), atol=2e-6)
    drawn = {"unit_ring": 1, "unit_cube": 3, "unit_sphere": 3, "unit_hemisphere": 3}.get(name, 2)
    np.testing.assert_array_equal(states.numpy(), chain[drawn])
