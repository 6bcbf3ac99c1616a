"""Kepler orbits of high eccentricity and a double pendulum: order, energy, horizon."""

import functools

import numpy as np

import warp as wp
import warp.report as report

#: Eccentricities are spread by this much over the bodies, so that no two runs are the same.
BODIES = 1024


@functools.cache
def make_orbit(real, method):
    """Many steps of `x'' = -x / |x|^3`, one body a thread; energies on the way of body 0."""
    vec2 = wp.types.vector(2, real)

    @wp.func
    def pull(x: vec2):
        r = wp.length(x)
        return -x / (r * r * r)

    @wp.func
    def energy(x: vec2, v: vec2):
        return real(0.5) * wp.dot(v, v) - real(1.0) / wp.length(x)

    @wp.func
    def leapfrog(x: vec2, v: vec2, dt: real):
        half = v + pull(x) * (real(0.5) * dt)
        x1 = x + half * dt
        return x1, half + pull(x1) * (real(0.5) * dt)

    @wp.func
    def rk4(x: vec2, v: vec2, dt: real):
        h = real(0.5) * dt
        a1 = pull(x)
        v2 = v + a1 * h
        a2 = pull(x + v * h)
        v3 = v + a2 * h
        a3 = pull(x + v2 * h)
        v4 = v + a3 * dt
        a4 = pull(x + v3 * dt)
        x1 = x + (v + (v2 + v3) * real(2.0) + v4) * (dt / real(6.0))
        return x1, v + (a1 + (a2 + a3) * real(2.0) + a4) * (dt / real(6.0))

    step = leapfrog if method == "leapfrog" else rk4

    @wp.kernel
    def orbit(
        x: wp.array(dtype=vec2),
        v: wp.array(dtype=vec2),
        dt: real,
        steps: int,
        every: int,
        energies: wp.array(dtype=real),
    ):
        i = wp.tid()
        xi, vi = x[i], v[i]
        for n in range(steps):
            if i == 0 and n % every == 0:
                energies[n // every] = energy(xi, vi)
            xi, vi = step(xi, vi, dt)
        x[i] = xi
        v[i] = vi

    return orbit


def perihelion(e):
    """Position and velocity at perihelion, shape (2,) each; semi-major axis and pull are 1."""
    return (1.0 - e, 0.0), (0.0, np.sqrt((1.0 + e) / (1.0 - e)))


def exact_orbit(case):
    """Kepler's equation M = E - e sin E by Newton's method in float64."""
    e, time = case.eccentricity, end_time(case)
    anomaly = time + e * np.sin(time)
    for _ in range(50):
        residual = anomaly - e * np.sin(anomaly) - time
        anomaly -= residual / (1.0 - e * np.cos(anomaly))
    across = np.sqrt(1.0 - e * e) * np.sin(anomaly)
    return {"position": np.array([np.cos(anomaly) - e, across])}


def end_time(case):
    """Whole steps to three quarters of a period of the second orbit."""
    return steps_of(case) * case.dt


def steps_of(case):
    return max(1, round(1.75 * 2.0 * np.pi / case.dt))


@report.scene(
    sweep=report.Sweep("dt", 3e-2, 1e-4, 8, quick=4),
    curves=(
        report.Sweep("method", values=("leapfrog", "rk4")),
        report.Sweep("eccentricity", values=(0.5, 0.9)),
    ),
    reference=report.Exact(exact_orbit, error=1e-14),
    diverged=2.5,
    # A step must resolve the passage of the perihelion, which takes about (1 - e)^1.5.
    expect=lambda case: "ok" if case.dt < 0.2 * (1.0 - case.eccentricity) ** 1.5 else "any",
)
def kepler(case):
    """1024 orbits over 1.75 periods, eccentricity 0.5 and 0.9, against Kepler's equation."""
    kernel = make_orbit(case.real, case.method)
    vec2 = wp.types.vector(2, case.real)
    steps = steps_of(case)
    every = max(1, steps // 200)
    start = [np.tile(part, (BODIES, 1)) for part in perihelion(case.eccentricity)]
    first = [wp.array(part, dtype=vec2, device=case.device) for part in start]
    x, v = (wp.clone(part) for part in first)
    samples = -(-steps // every)
    energies = wp.zeros(samples, dtype=case.real, device=case.device)

    def reset():
        wp.copy(x, first[0])
        wp.copy(v, first[1])

    def run():
        inputs = [x, v, case.dt, steps, every, energies]
        wp.launch(kernel, BODIES, inputs, device=case.device)

    def quantities():
        times = np.arange(samples) * every * case.dt
        drift = energies.numpy().astype(np.float64) / -0.5 - 1.0
        return {"position": x.numpy()[0], "energy drift": report.Series(times, drift)}

    return report.Program(run, quantities, reset, work=BODIES * steps)


@functools.cache
def make_pendulum(real, method):
    """Two unit masses on unit rods, g = 9.81; state (angles, their rates)."""
    vec4 = wp.types.vector(4, real)

    @wp.func
    def slope(s: vec4):
        g = real(9.81)
        d = s[0] - s[1]
        sine, cosine = wp.sin(d), wp.cos(d)
        bottom = real(2.0) - cosine * cosine
        w1, w2 = s[2] * s[2], s[3] * s[3]
        top1 = g * (wp.sin(s[1]) * cosine - real(2.0) * wp.sin(s[0]))
        top1 -= (w2 + w1 * cosine) * sine
        top2 = real(2.0) * (w1 * sine - g * wp.sin(s[1]) + g * wp.sin(s[0]) * cosine)
        top2 += w2 * sine * cosine
        return vec4(s[2], s[3], top1 / bottom, top2 / bottom)

    @wp.func
    def rk4(s: vec4, dt: real):
        h = real(0.5) * dt
        a = slope(s)
        b = slope(s + a * h)
        c = slope(s + b * h)
        d = slope(s + c * dt)
        return s + (a + (b + c) * real(2.0) + d) * (dt / real(6.0))

    @wp.func
    def midpoint(s: vec4, dt: real):
        middle = s + slope(s) * (real(0.5) * dt)
        for _ in range(12):
            middle = s + slope(middle) * (real(0.5) * dt)
        return middle * real(2.0) - s

    step = rk4 if method == "rk4" else midpoint

    @wp.kernel
    def pendulum(state: wp.array(dtype=vec4), dt: real, steps: int):
        i = wp.tid()
        s = state[i]
        for _ in range(steps):
            s = step(s, dt)
        state[i] = s

    return pendulum


def pendulum_energy(state):
    """Energy of shape (..., 4) states; zero with both rods horizontal and at rest."""
    a, b, p, q = np.moveaxis(np.asarray(state, np.float64), -1, 0)
    kinetic = p * p + 0.5 * q * q + p * q * np.cos(a - b)
    return kinetic - 9.81 * (2.0 * np.cos(a) + np.cos(b))


@report.scene(
    sweep=report.Sweep("dt", 1e-1, 1e-3, 7, quick=4),
    curves=(report.Sweep("method", values=("rk4", "implicit midpoint")),),
    reference=report.Converged(
        {"method": "rk4", "dt": 1.0 / 16384}, {"method": "implicit midpoint", "dt": 1.0 / 65536}
    ),
    diverged=3.0,
    horizon=1.0,
)
def double_pendulum(case):
    """256 double pendulums released from the horizontal; energy, and angles over one second."""
    kernel = make_pendulum(case.real, case.method)
    vec4 = wp.types.vector(4, case.real)
    steps = max(1, round(case.horizon / case.dt))
    dt = case.horizon / steps
    begin = np.zeros((256, 4))
    begin[:, :2] = np.pi / 2.0
    begin[:, 1] += np.linspace(0.0, 0.1, 256)
    first = wp.array(begin, dtype=vec4, device=case.device)
    state = wp.clone(first)
    before = pendulum_energy(first.numpy())

    def run():
        wp.launch(kernel, 256, [state, dt, steps], device=case.device)

    def quantities():
        after = state.numpy()
        drift = np.abs(pendulum_energy(after) - before).max() / (3.0 * 9.81)
        return {"angles": after[:, :2], "energy": report.Error(float(drift))}

    return report.Program(run, quantities, lambda: wp.copy(state, first), work=256 * steps)
