"""Programs for sanitize.py: kernels of every sort, small, with their results checked.

    python sanitize_work.py [wild|unset]

`wild` and `unset` run one kernel with a planted fault, for the tools to find.
"""

import sys

import numpy as np

import warp as wp

CARD = "cuda:0"
N = 3001
rng = np.random.default_rng(11)


@wp.struct
class Body:
    position: wp.vec3
    mass: float
    trail: wp.array(dtype=wp.vec3)


@wp.func
def bend(x: float):
    return wp.sin(x) * wp.exp(-x * x)


@wp.kernel
def saxpy(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = a * x[i] + bend(y[i])


@wp.kernel
def integrate(x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), dt: float):
    i = wp.tid()
    v[i] = v[i] + wp.vec3(0.0, -9.8, 0.0) * dt
    x[i] += v[i] * dt


@wp.kernel
def stencil(u: wp.array3d(dtype=float), out: wp.array3d(dtype=float)):
    i, j, k = wp.tid()
    if i > 0 and i < u.shape[0] - 1:
        out[i, j, k] = u[i - 1, j, k] + u[i + 1, j, k] - 2.0 * u[i, j, k]


@wp.kernel
def reduce(
    x: wp.array(dtype=float),
    total: wp.array(dtype=float),
    least: wp.array(dtype=float),
    most: wp.array(dtype=float),
    points: wp.array(dtype=wp.vec3),
    count: wp.array(dtype=int),
):
    i = wp.tid()
    wp.atomic_add(total, 0, x[i])
    wp.atomic_min(least, 0, x[i])
    wp.atomic_max(most, 0, x[i])
    wp.atomic_add(points, 0, wp.vec3(x[i], 2.0 * x[i], 1.0))
    if x[i] > 0.5:
        wp.atomic_add(count, 0, 1)


@wp.kernel
def reduce_grid(x: wp.array2d(dtype=float), total: wp.array(dtype=float)):
    i, j = wp.tid()
    wp.atomic_add(total, 0, x[i, j])


@wp.kernel
def scatter(x: wp.array(dtype=float), y: wp.array(dtype=wp.float64), places: int):
    i = wp.tid()
    wp.atomic_add(y, i % places, wp.float64(x[i]))


@wp.kernel
def matrices(a: wp.array(dtype=wp.mat33), b: wp.array(dtype=wp.vec3), q: wp.quat):
    i = wp.tid()
    inverse = wp.inverse(a[i])
    b[i] = wp.quat_rotate(q, inverse * b[i])
    a[i] = inverse


@wp.kernel
def search(x: wp.array(dtype=float), steps: wp.array(dtype=int)):
    i = wp.tid()
    value = x[i] + 1.0
    n = int(0)
    while value < 100.0:
        value = value * 1.5
        n += 1
        if n > 50:
            break
    for j in range(n):
        if j % 2 == 0:
            continue
        steps[i] += j


@wp.kernel
def move(bodies: wp.array(dtype=Body), single: Body):
    i = wp.tid()
    b = bodies[i]
    b.position = b.position + single.position * b.mass
    bodies[i] = b
    single.trail[i] = b.position


@wp.kernel
def rows(x: wp.array2d(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    row = x[i]
    s = float(0.0)
    for j in range(row.shape[0]):
        s += row[j]
    out[i] = s


@wp.kernel
def random(seed: int, out: wp.array(dtype=float)):
    i = wp.tid()
    state = wp.rand_init(seed, i)
    out[i] = wp.randf(state) + wp.randn(state)


@wp.kernel
def say(x: wp.array(dtype=float)):
    i = wp.tid()
    if i == 0:
        wp.printf("%d %f\n", i, x[i])


def floats(*shape):
    return rng.random(shape, dtype=np.float32)


def on_card(data, dtype=float):
    return wp.array(data, dtype=dtype, device=CARD)


def streams():
    """One item and several per thread."""
    for n in (1, 31, N, 1 << 20):
        x, y = floats(n), floats(n)
        card = on_card(y)
        wp.launch(saxpy, n, [2.0, on_card(x), card], device=CARD)
        exact = 2.0 * x + np.sin(y) * np.exp(-y * y)
        np.testing.assert_allclose(card.numpy(), exact, rtol=1e-5)


def vectors():
    x, v = floats(N, 3), floats(N, 3)
    card, speed = on_card(x, wp.vec3), on_card(v, wp.vec3)
    wp.launch(integrate, N, [card, speed, 0.1], device=CARD)
    moved = v + np.float32(0.1) * np.array([0.0, -9.8, 0.0], np.float32)
    np.testing.assert_allclose(card.numpy(), x + moved * np.float32(0.1), rtol=1e-4, atol=1e-6)


def grids():
    u = floats(9, 17, 33)
    out = wp.zeros(u.shape, dtype=float, device=CARD)
    wp.launch(stencil, u.shape, [on_card(u), out], device=CARD)
    np.testing.assert_allclose(out.numpy()[1:-1], u[:-2] + u[2:] - 2 * u[1:-1], atol=1e-5)


def reductions():
    x = floats(N)
    total, least, most = (wp.full(1, value, device=CARD) for value in (0.0, 9.0, -9.0))
    points, count = wp.zeros(1, dtype=wp.vec3, device=CARD), wp.zeros(1, dtype=int, device=CARD)
    wp.launch(reduce, N, [on_card(x), total, least, most, points, count], device=CARD)
    np.testing.assert_allclose(total.numpy()[0], x.sum(), rtol=1e-4)
    assert least.numpy()[0] == x.min() and most.numpy()[0] == x.max()
    np.testing.assert_allclose(points.numpy()[0], [x.sum(), 2 * x.sum(), N], rtol=1e-4)
    assert count.numpy()[0] == (x > 0.5).sum()
    grid = floats(37, 41)
    total.zero_()
    wp.launch(reduce_grid, grid.shape, [on_card(grid), total], device=CARD)
    np.testing.assert_allclose(total.numpy()[0], grid.sum(), rtol=1e-4)


def scattered():
    x = floats(N)
    y = wp.zeros(7, dtype=wp.float64, device=CARD)
    wp.launch(scatter, N, [on_card(x), y, 7], device=CARD)
    exact = [x[k::7].astype(np.float64).sum() for k in range(7)]
    np.testing.assert_allclose(y.numpy(), exact, rtol=1e-9)


def linear_algebra():
    a, b = floats(N, 3, 3) + 2 * np.eye(3, dtype=np.float32), floats(N, 3)
    inverses, card = on_card(a, wp.mat33), on_card(b, wp.vec3)
    wp.launch(matrices, N, [inverses, card, wp.quat_identity()], device=CARD)
    exact = np.linalg.inv(a.astype(np.float64))
    np.testing.assert_allclose(inverses.numpy(), exact, rtol=1e-3, atol=1e-4)
    solved = (exact @ b[..., None].astype(np.float64))[..., 0]
    np.testing.assert_allclose(card.numpy(), solved, rtol=1e-3, atol=1e-4)


def control_flow():
    steps = wp.zeros(N, dtype=int, device=CARD)
    wp.launch(search, N, [on_card(floats(N)), steps], device=CARD)
    assert steps.numpy().min() > 0


def structs():
    single = Body()
    single.position, single.mass = wp.vec3(1.0, 2.0, 3.0), 1.0
    single.trail = wp.zeros(4, dtype=wp.vec3, device=CARD)
    bodies = wp.zeros(4, dtype=Body, device=CARD)
    wp.launch(move, 4, [bodies, single], device=CARD)
    assert (single.trail.numpy() == 0.0).all()


def views():
    x = floats(20, 30)
    card, out = on_card(x), wp.zeros(10, dtype=float, device=CARD)
    wp.launch(rows, 10, [card[::2], out], device=CARD)
    np.testing.assert_allclose(out.numpy(), x[::2].sum(1), rtol=1e-5)
    turned = wp.zeros((30, 20), dtype=float, device=CARD)
    wp.copy(turned, card.transpose())
    assert (turned.numpy() == x.T).all()
    part = card[3:7, ::3]
    assert (part.numpy() == x[3:7, ::3]).all()
    part.fill_(2.0)
    part.assign(floats(4, 10))
    assert (wp.clone(card.transpose()).numpy() == card.numpy().T).all()


def random_numbers():
    out = wp.empty(N, dtype=float, device=CARD)
    wp.launch(random, N, [5, out], device=CARD)
    assert np.isfinite(out.numpy()).all()


def streams_and_frees():
    """Memory that goes while work on another stream still uses it."""
    other = wp.Stream(CARD)
    for step in range(8):
        x = wp.full(N, 1.0, device=CARD)
        other.wait_stream(wp.get_stream(CARD))
        with wp.ScopedStream(other):
            y = wp.zeros(N, dtype=float, device=CARD)
            wp.launch(saxpy, N, [float(step), x, y], device=CARD)
            result = y.numpy()
        assert (result == step).all()
        wp.get_stream(CARD).wait_stream(other)
        del x, y


def debug_mode():
    """Accesses out of bounds are reported, and do not happen."""
    former, wp.config.mode = wp.config.mode, "debug"
    try:
        x, y = wp.ones(4, device=CARD), wp.zeros(2, device=CARD)
        try:
            wp.launch(saxpy, 4, [2.0, x, y], device=CARD)
            wp.synchronize_device(CARD)
        except RuntimeError:
            return
        raise AssertionError("an access out of bounds is not reported")
    finally:
        wp.config.mode = former


def output():
    wp.launch(say, 4, [wp.ones(4, device=CARD)], device=CARD)
    wp.synchronize_device(CARD)


def graphs():
    if not hasattr(wp, "ScopedCapture"):
        return
    x, y = wp.ones(N, device=CARD), wp.zeros(N, device=CARD)
    wp.launch(saxpy, N, [1.0, x, y], device=CARD)
    y.zero_()
    with wp.ScopedCapture(device=CARD) as capture:
        y.zero_()
        wp.launch(saxpy, N, [3.0, x, y], device=CARD)
    for _ in range(3):
        wp.capture_launch(capture.graph)
    assert (y.numpy() == 3.0).all()


def wild():
    x, y = wp.ones(64, device=CARD), wp.array(ptr=4096, shape=64, dtype=float, device=CARD)
    wp.launch(saxpy, 64, [2.0, x, y], device=CARD)
    wp.synchronize_device(CARD)


def unset():
    x, y = (wp.empty(64, dtype=float, device=CARD) for _ in range(2))
    wp.launch(saxpy, 64, [2.0, x, y], device=CARD)
    wp.synchronize_device(CARD)


PARTS = [
    streams,
    vectors,
    grids,
    reductions,
    scattered,
    linear_algebra,
    control_flow,
    structs,
    views,
    random_numbers,
    streams_and_frees,
    debug_mode,
    output,
    graphs,
]


def main():
    wp.config.quiet = True
    if len(sys.argv) > 1:
        {"wild": wild, "unset": unset}[sys.argv[1]]()
        return
    failed = 0
    for part in PARTS:
        try:
            part()
        except Exception as error:  # the parts after it are inspected, too
            failed += 1
            text = " ".join(str(error).split())[:300]
            print(f"{part.__name__} fails: {type(error).__name__}: {text}", flush=True)
    wp.synchronize_device(CARD)
    print(f"{len(PARTS) - failed} parts done")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
