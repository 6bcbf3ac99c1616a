"""T112 to T114 and T118: long simulations, and one gradient from several compilers."""

import numpy as np

import warp as wp

from .problem import deterministic, gradient, kernel, setting
from .registry import case


@case("T112", "a thousand steps with eight snapshots have the bits of the full tape")
def checkpointed(p):
    R, n, steps = p.real, 16, 1000

    @kernel
    def forces(x: wp.array(dtype=R), f: wp.array(dtype=R)):
        i = wp.tid()
        d = x[i + 1] - x[i]
        pull = R(4.0) * (d - R(1.0)) + R(0.5) * d * d * d
        wp.atomic_add(f, i, pull)
        wp.atomic_sub(f, i + 1, pull)

    @kernel
    def clear(f: wp.array(dtype=R)):
        f[wp.tid()] = R(0.0)

    @kernel
    def advance(x: wp.array(dtype=R), v: wp.array(dtype=R), f: wp.array(dtype=R)):
        i = wp.tid()
        v[i] = v[i] + R(0.01) * f[i]
        x[i] = x[i] + R(0.01) * v[i]

    start, speed = np.arange(n) * 1.01, 0.1 * p.random(n)
    weights = p.random(n)

    def run(snapshots):
        x, v, f = p.array(start), p.array(speed), p.zeros(n)

        def step(_):
            p.launch(clear, n, [f])
            p.launch(forces, n - 1, [x], [f])
            p.launch(advance, n, [x, v, f])

        with wp.Tape(preserve="auto") as tape:
            if snapshots:
                wp.autograd.checkpoint(step, steps, state=[x, v, f], snapshots=snapshots)
            else:
                for k in range(steps):
                    step(k)
        tape.backward(grads={x: p.seed(x, weights)})
        return x.numpy(), gradient(x), gradient(v)

    with deterministic():
        full, few = run(0), run(8)
    for whole, some in zip(full, few):
        p.same(some, whole)
    p.holds(np.abs(full[1]).max() > 0.0, "the gradient is 0")


@case("T113", "a bounce at the time of impact turns the sign of the height's derivative")
def bounce(p):
    R = p.real

    @kernel
    def fall(height: wp.array(dtype=R), steps: int, dt: R, y: wp.array(dtype=R)):
        i = wp.tid()
        h = height[i]
        v = R(-1.0)
        for _ in range(steps):
            ahead = h + v * dt
            if ahead < R(0.0):
                impact = -h / v
                v = -v
                h = v * (dt - impact)
            else:
                h = ahead
        y[i] = h

    inputs = [p.array([0.7, 0.33, 0.101]), 100, 0.013]
    (got,) = p.pullback(fall, 3, inputs, [p.zeros(3)])
    p.close(got, [-1.0] * 3)


@case("T114", "ten thousand steps of an oscillator have the matrix power as Jacobian")
def oscillator(p):
    R, n = p.real, 10**4
    dt = 2.0**-7

    @kernel
    def swing(
        x: wp.array(dtype=R),
        v: wp.array(dtype=R),
        n: int,
        a: wp.array(dtype=R),
        b: wp.array(dtype=R),
    ):
        i = wp.tid()
        position = x[i]
        speed = v[i]
        for _ in range(n):
            speed = speed - R(dt) * position
            position = position + R(dt) * speed
        a[i] = position
        b[i] = speed

    w = p.random(2)
    inputs = [p.array([1.0]), p.array([0.5]), n]
    got = p.pullback(swing, 1, inputs, [p.zeros(1), p.zeros(1)], list(w))
    step = np.array([[1.0 - dt * dt, dt], [-dt, 1.0]])
    expected = np.linalg.matrix_power(step, n).T @ w
    p.near(np.ravel(got), expected, 4 * n * p.eps)


@case("T118", "the gradient without optimisation, and on each device, is the same")
def compilers(p):
    def build():
        R = p.real

        @kernel
        def waves(x: wp.array(dtype=R), n: int, y: wp.array(dtype=R)):
            i = wp.tid()
            s = x[i]
            for k in range(n):
                s = wp.sin(s) * wp.exp(-s) + x[k] * R(0.5)
            y[i] = s

        return waves

    data = p.random(8)
    found = []
    for level in (0, 3):
        with setting(optimization_level=level):
            found += p.pullback(build(), 8, [p.array(data), 8], [p.zeros(8)])
    p.close(found[0], found[1], 64)
    if p.device != "cpu":
        other = type(p)(p.precision, "cpu")
        (host,) = other.pullback(build(), 8, [other.array(data), 8], [other.zeros(8)])
        p.close(found[1], host, 64)
