"""Gradients through loops that read what they wrote: chains and trees of joints, errors."""

import numpy as np
import pytest

import warp as wp

REAL = wp.float64
rng = np.random.default_rng(3)


@wp.func
def placed(at: wp.vec3d, turn: wp.quatd, q: REAL, axis: wp.vec3d, arm: wp.vec3d):
    local = wp.quat_from_axis_angle(axis, q)
    whole = turn * local
    return at + wp.quat_rotate(whole, arm), whole


@wp.kernel
def kinematics(
    first: wp.array(dtype=int),
    parent: wp.array(dtype=int),
    child: wp.array(dtype=int),
    q: wp.array(dtype=REAL),
    axis: wp.array(dtype=wp.vec3d),
    arm: wp.array(dtype=wp.vec3d),
    at: wp.array(dtype=wp.vec3d),
    turn: wp.array(dtype=wp.quatd),
):
    tree = wp.tid()
    for joint in range(first[tree], first[tree + 1]):
        up = parent[joint]
        start = wp.vec3d()
        frame = wp.quatd(REAL(0.0), REAL(0.0), REAL(0.0), REAL(1.0))
        if up >= 0:
            start = at[up]
            frame = turn[up]
        end, whole = placed(start, frame, q[joint], axis[joint], arm[joint])
        at[child[joint]] = end
        turn[child[joint]] = whole


def quat_mul(a, b):
    """Product of quaternions (x, y, z, w)."""
    v = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(v, a[3] * b[3] - a[:3] @ b[:3])


def expected(first, parent, child, q, axis, arm, weights):
    """Weighted sum of the positions in NumPy."""
    at, turn = np.zeros((len(q), 3)), np.zeros((len(q), 4))
    for joint in range(first[-1]):
        up = parent[joint]
        frame = turn[up] if up >= 0 else np.array([0.0, 0.0, 0.0, 1.0])
        local = np.append(np.sin(q[joint] / 2) * axis[joint], np.cos(q[joint] / 2))
        whole = quat_mul(frame, local)
        u, w = whole[:3], whole[3]
        v = arm[joint]
        turned = v + 2.0 * np.cross(u, np.cross(u, v) + w * v)
        at[child[joint]] = (at[up] if up >= 0 else 0.0) + turned
        turn[child[joint]] = whole
    return (at * weights).sum()


def trees(sizes, is_chain):
    """First joints, parents and bodies, which are numbered in any order."""
    first = np.cumsum([0, *sizes])
    child = rng.permutation(first[-1])
    parent = np.full(first[-1], -1)
    for start, end in zip(first, first[1:]):
        for joint in range(start + 1, end):
            before = joint - 1 if is_chain else rng.integers(start, joint)
            parent[joint] = child[before]
    return first, parent, child


@pytest.mark.parametrize(
    ("sizes", "is_chain"), [([2], 1), ([7], 1), ([64], 1), ([3, 0, 9], 0), ([30, 1, 17], 0)]
)
@pytest.mark.parametrize("tape", ["checkpoints", "global"])
def test_chains_and_trees_of_joints(sizes, is_chain, tape, device):
    first, parent, child = trees(sizes, is_chain)
    n = len(child)
    q, arm, weights = rng.normal(size=n), rng.normal(size=(n, 3)), rng.normal(size=(n, 3))
    axis = rng.normal(size=(n, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    indices = [wp.array(one, dtype=int, device=device) for one in (first, parent, child)]
    fixed = [wp.array(one, dtype=wp.vec3d, device=device) for one in (axis, arm)]
    kernel = wp.Kernel(kinematics.func, key=f"kinematics_{tape}", options={"tape": tape})

    def bodies(angles):
        at = wp.zeros(n, dtype=wp.vec3d, device=device, requires_grad=True)
        turn = wp.zeros(n, dtype=wp.quatd, device=device, requires_grad=True)
        wp.launch(kernel, len(sizes), [*indices, angles, *fixed, at, turn], device=device)
        return at

    angles = wp.array(q, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as recorded:
        at = bodies(angles)
    recorded.backward(grads={at: wp.array(weights, dtype=wp.vec3d, device=device)})
    got = angles.grad.numpy()
    step = 1e-6
    for joint in range(n):
        moved = np.eye(n)[joint] * step
        high, low = (
            expected(first, parent, child, q + sign * moved, axis, arm, weights) for sign in (1, -1)
        )
        assert got[joint] == pytest.approx((high - low) / (2 * step), rel=1e-6, abs=1e-6)
    direction = rng.normal(size=n)
    tangents = wp.array(direction, dtype=REAL, device=device)
    pushed = wp.autograd.jvp(bodies, [angles], [tangents])
    pushed = pushed[0] if isinstance(pushed, (list, tuple)) else pushed
    assert (pushed.numpy() * weights).sum() == pytest.approx(got @ direction, rel=1e-10)


def test_rows_normalised_in_place(device):
    """The logarithm of a softmax, whose loops overwrite what they have read."""

    @wp.kernel
    def normalise(y: wp.array2d(dtype=REAL)):
        i = wp.tid()
        high = y[i, 0]
        for j in range(y.shape[1]):
            high = wp.max(high, y[i, j])
        total = REAL(0.0)
        for j in range(y.shape[1]):
            total += wp.exp(y[i, j] - high)
        for j in range(y.shape[1]):
            y[i, j] = y[i, j] - high - wp.log(total)
        for j in range(y.shape[1]):
            y[i, j] = wp.exp(y[i, j]) * y[i, j]

    x, weights = rng.normal(size=(2, 5, 9))
    y = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(normalise, 5, [y], device=device)
    tape.backward(grads={y: wp.array(weights, dtype=REAL, device=device)})
    p = np.exp(x) / np.exp(x).sum(axis=1, keepdims=True)
    slope = weights * (np.log(p) + 1.0) * p
    wanted = slope - p * slope.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(y.grad.numpy(), wanted, rtol=1e-11)


@wp.struct
class Bodies:
    x: wp.array(dtype=REAL)
    order: wp.array2d(dtype=int)


@wp.func
def advance(bodies: Bodies, to: int, come: int, k: REAL):
    bodies.x[to] = wp.sin(k * bodies.x[come]) + bodies.x[to]


def test_arrays_of_structs_in_functions_and_while(device):
    @wp.kernel
    def run(bodies: Bodies, k: wp.array(dtype=REAL), limit: REAL):
        i = wp.tid()
        step = int(0)
        while step + 1 < bodies.order.shape[1] and bodies.x[bodies.order[i, step]] < limit:
            for again in range(step):
                advance(bodies, bodies.order[i, step + 1], bodies.order[i, again], k[i])
            step += 1

    order = rng.permutation(24).reshape(4, 6)
    x, k, weights = rng.normal(size=24), rng.normal(size=4), rng.normal(size=24)

    def plain(x, k):
        x = x.copy()
        for i in range(4):
            step = 0
            while step + 1 < 6 and x[order[i, step]] < 0.9:
                for again in range(step):
                    x[order[i, step + 1]] += np.sin(k[i] * x[order[i, again]])
                step += 1
        return x @ weights

    bodies = Bodies()
    bodies.x = wp.array(x, dtype=REAL, device=device, requires_grad=True)
    bodies.order = wp.array(order, dtype=int, device=device)
    stiffness = wp.array(k, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(run, 4, [bodies, stiffness, 0.9], device=device)
    seed = wp.array(weights, dtype=REAL, device=device)
    tape.backward(grads={bodies.x: seed})
    step = 1e-6
    for one, got in ((x, bodies.x.grad.numpy()), (k, stiffness.grad.numpy())):
        for j in range(len(one)):
            moved = np.eye(len(one))[j] * step
            pair = [(x + s * moved, k) if one is x else (x, k + s * moved) for s in (1, -1)]
            slope = (plain(*pair[0]) - plain(*pair[1])) / (2 * step)
            assert got[j] == pytest.approx(slope, rel=1e-6, abs=1e-7)


@wp.kernel
def squares(p: wp.array(dtype=int), x: wp.array(dtype=REAL), n: int):
    i = wp.tid()
    for j in range(n):
        x[p[i * n + j]] = x[p[i * n + j]] * x[p[(i * n + j + 1) % p.shape[0]]]


def test_threads_that_meet_are_an_error(device):
    p = wp.array(np.arange(6), dtype=int, device=device)
    x = wp.array(np.arange(1.0, 7.0), dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(squares, 2, [p, x, 3], device=device)
    with pytest.raises(RuntimeError, match=r"py:\d+:\d+: an element .* another thread"):
        tape.backward(grads={x: wp.ones(6, dtype=REAL, device=device)})


def test_one_thread_may_touch_all(device):
    p = wp.array([0, 1, 2], dtype=int, device=device)
    x = wp.array([2.0, 3.0, 5.0], dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(squares, 1, [p, x, 3], device=device)
    for _ in range(2):
        tape.zero()
        tape.backward(grads={x: wp.ones(3, dtype=REAL, device=device)})
        # a b, b c, c a b for (a, b, c)
        np.testing.assert_allclose(x.grad.numpy(), [3 + 15, 2 + 5 + 10, 3 + 6])


def test_no_iterations(device):
    p = wp.array([0, 1, 2], dtype=int, device=device)
    x = wp.array([2.0, 3.0, 5.0], dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(squares, 1, [p, x, 0], device=device)
    tape.backward(grads={x: wp.ones(3, dtype=REAL, device=device)})
    np.testing.assert_allclose(x.grad.numpy(), 1.0)


def test_later_launches_overwrite_what_was_read(device):
    """The tape keeps what a second run of the first launch starts from."""
    p = wp.array([0, 1, 2], dtype=int, device=device)
    x = wp.array([2.0, 3.0, 5.0], dtype=REAL, device=device, requires_grad=True)
    y = wp.zeros(3, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        for _ in range(3):
            wp.launch(squares, 1, [p, x, 3], device=device)
        wp.copy(y, x)
        p.fill_(1)
        x.fill_(7.0)
    tape.backward(grads={y: wp.ones(3, dtype=REAL, device=device)})

    def plain(x):
        x = x.copy()
        for _ in range(3):
            for j in range(3):
                x[j] *= x[(j + 1) % 3]
        return x.sum()

    # By polynomials in exact arithmetic: complex step.
    start = np.array([2.0, 3.0, 5.0])
    wanted = [plain(start + 1e-30j * np.eye(3)[j]).imag / 1e-30 for j in range(3)]
    np.testing.assert_allclose(x.grad.numpy() + 0.0, wanted, rtol=1e-12)


def test_without_a_tape_nobody_knows_what_was_there():
    p = wp.array([0, 1, 2], dtype=int, device="cpu")
    x = wp.array([2.0, 3.0, 5.0], dtype=REAL, device="cpu", requires_grad=True)
    with pytest.raises(RuntimeError, match="array 'x' as it was before the launch"):
        wp.launch(squares, 1, [p, x, 3], adj_inputs=[None, x.grad], adjoint=True, device="cpu")


@wp.kernel
def through_parents(
    x: wp.array2d(dtype=REAL), parent: wp.array(dtype=int), n: int, y: wp.array2d(dtype=REAL)
):
    i = wp.tid()
    y[i, 0] = wp.sin(x[i, 0])
    for k in range(1, n):
        y[i, k] = wp.sin(y[i, parent[k]] + x[i, k])


@pytest.mark.parametrize("recorded", [True, False])
@pytest.mark.parametrize(("rows", "n"), [(1, 1), (3, 2), (40, 17)])
def test_rows_as_trees(recorded, rows, n, device):
    """Each element is written before it is read: a launch needs no tape."""
    parent = np.array([0, *(rng.integers(0, k) for k in range(1, n))])
    start, weights = rng.normal(size=(2, rows, n))
    x = wp.array(start, dtype=REAL, device=device, requires_grad=True)
    y = wp.full((rows, n), 5.0, dtype=REAL, device=device, requires_grad=True)
    tree = wp.array(parent, dtype=int, device=device)
    seed = wp.array(weights, dtype=REAL, device=device)
    with wp.Tape() as tape:
        wp.launch(through_parents, rows, [x, tree, n, y], device=device)
    if recorded:
        tape.backward(grads={y: seed})
    else:
        wp.copy(y.grad, seed)
        wp.launch(
            through_parents,
            rows,
            [x, tree, n, y],
            adj_inputs=[x.grad, None, None, y.grad],
            adjoint=True,
            device=device,
        )
    moved, slopes = np.zeros((2, rows, n))
    for k in range(n):
        moved[:, k] = start[:, k] + (np.sin(moved[:, parent[k]]) if k else 0.0)
    wanted, left = np.zeros((rows, n)), weights.copy()
    for k in range(n - 1, -1, -1):
        slopes = left[:, k] * np.cos(moved[:, k])
        wanted[:, k] = slopes
        if k:
            left[:, parent[k]] += slopes
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-12)


def test_a_launch_without_a_tape_must_write_before_it_reads(device):
    """A parent that comes later, and an element to which the launch adds."""

    @wp.kernel
    def gathered(x: wp.array(dtype=REAL), p: wp.array(dtype=int), y: wp.array(dtype=REAL)):
        for k in range(3):
            wp.atomic_add(y, p[k], wp.sin(y[p[k]]) * x[k])

    x = wp.array(rng.normal(size=(1, 3)), dtype=REAL, device=device, requires_grad=True)
    y = wp.zeros((1, 3), dtype=REAL, device=device, requires_grad=True)
    tree = wp.array([0, 2, 0], dtype=int, device=device)
    with pytest.raises(RuntimeError, match="array 'y' as it was before the launch"):
        wp.launch(
            through_parents,
            1,
            [x, tree, 3, y],
            adj_inputs=[x.grad, None, None, y.grad],
            adjoint=True,
            device=device,
        )
        wp.synchronize_device(device)
    x, y = x.flatten(), y.flatten()
    with pytest.raises(RuntimeError, match="array 'y' as it was before the launch"):
        wp.launch(
            gathered,
            1,
            [x, tree, y],
            adj_inputs=[x.grad, None, y.grad],
            adjoint=True,
            device=device,
        )


def test_second_derivatives_are_an_error():
    p = wp.array([0, 1, 2], dtype=int, device="cpu")

    def total(x):
        y, e = wp.clone(x), wp.zeros(1, dtype=REAL, device="cpu", requires_grad=True)
        wp.launch(squares, 1, [p, y, 3], device="cpu")
        wp.launch(add_up, 3, [y, e], device="cpu")
        return e

    @wp.kernel
    def add_up(y: wp.array(dtype=REAL), e: wp.array(dtype=REAL)):
        wp.atomic_add(e, 0, y[wp.tid()])

    x = wp.array([2.0, 3.0, 5.0], dtype=REAL, device="cpu", requires_grad=True)
    with pytest.raises(RuntimeError, match="second derivatives through loops that read"):
        wp.autograd.hvp(total, inputs=[x], vectors=[wp.ones_like(x)])


def test_a_condition_about_memory_that_changes(device):
    @wp.kernel
    def halve(x: wp.array2d(dtype=REAL), p: wp.array(dtype=int)):
        i = wp.tid()
        while x[i, p[i]] > REAL(0.5):
            x[i, p[i]] = REAL(0.5) * x[i, p[i]] * x[i, p[i]]

    start = np.array([[0.1, 0.7], [1.9, 0.2], [0.3, 1.5]])
    p = np.array([1, 0, 0], dtype=np.int32)
    x = wp.array(start, dtype=REAL, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(halve, 3, [x, wp.array(p, dtype=int, device=device)], device=device)
    tape.backward(grads={x: wp.ones((3, 2), dtype=REAL, device=device)})
    wanted = np.ones((3, 2))
    for i, k in enumerate(p):
        value = start[i, k]
        while value > 0.5:
            wanted[i, k] *= value
            value = 0.5 * value * value
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-14)


@wp.kernel
def until_negative(
    p: wp.array(dtype=int),
    w: wp.array(dtype=int),
    x: wp.array2d(dtype=wp.float64),
    y: wp.array2d(dtype=wp.float64),
):
    i = wp.tid()
    for k in range(p.shape[0]):
        v = y[i, p[k]]
        if v < wp.float64(0.0):
            break
        y[i, w[k]] = -v * v * x[i, k]


def test_loops_that_depend_on_what_was_overwritten(device):
    """A second run on what the launch has left would leave the loop elsewhere: a tape is needed."""
    p = wp.array([0, 1, 0, 2], dtype=int, device=device)
    w = wp.array([0, 1, 2, 2], dtype=int, device=device)
    start, factors = np.array([[2.0, 3.0, 5.0]] * 9), np.full((9, 4), 0.5)
    # The elements 0 and 1 are squared, then the first one is negative.
    left, wanted = start.copy(), np.zeros((9, 4))
    left[:, :2] = -0.5 * start[:, :2] ** 2
    wanted[:, :2] = -(start[:, :2] ** 2)

    def make(values):
        return wp.array(values, dtype=wp.float64, device=device, requires_grad=True)

    x, first = make(factors), make(start)
    y = wp.zeros_like(first)
    with wp.Tape(preserve="auto") as tape:
        wp.copy(y, first)
        wp.launch(until_negative, 9, [p, w, x, y], device=device)
    np.testing.assert_allclose(y.numpy(), left)
    tape.backward(grads={y: wp.ones_like(y, requires_grad=False)})
    np.testing.assert_allclose(x.grad.numpy(), wanted)

    x, y = make(factors), make(left)
    y.grad.fill_(1.0)
    with pytest.raises(RuntimeError, match="'y' as it was before the launch"):
        wp.launch(until_negative, 9, [p, w, x, y], device=device, adjoint=True)
