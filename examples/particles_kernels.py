"""Kernels of the particle demonstration, and the exact solution they are judged by.

Every particle obeys

    x' = v,    v' = gravity + w k (wind cos(gust t) - v)

with inverse mass `w` [1/kg], drag coefficient `k` [kg/s], gravity [m/s^2] and a wind [m/s] that
swings with the frequency `gust` [rad/s]: linear drag, which has a closed-form solution
(`exact_flight`).
"""

# The types of the kernels are arguments of a function, which checkers do not follow.
# pyright: reportInvalidTypeForm=false
# mypy: disable-error-code="valid-type"

from types import SimpleNamespace

import numpy as np

import warp as wp


def make_kernels(real):
    """Build the kernels for one precision.

    Args:
        real: `wp.float32` or `wp.float64`.

    Returns:
        A namespace with `drag`, `integrate`, `midpoint` and the types `real`, `vec3`.
    """
    vec3 = wp.types.vector(3, real)

    @wp.kernel
    def drag(v: wp.array[vec3], k: real, wind: vec3, f: wp.array[vec3]):
        i = wp.tid()
        f[i] = (wind - v[i]) * k

    @wp.kernel
    def integrate(
        x: wp.array[vec3],
        v: wp.array[vec3],
        f: wp.array[vec3],
        w: wp.array[real],
        gravity: vec3,
        dt: real,
    ):
        tid = wp.tid()

        x0 = x[tid]
        v0 = v[tid]

        # Semi-implicit Euler: the new velocity moves the particle.
        f_ext = f[tid]
        inv_mass = w[tid]
        v1 = v0 + (f_ext * inv_mass + gravity) * dt
        x1 = x0 + v1 * dt

        x[tid] = x1
        v[tid] = v1

    @wp.kernel
    def midpoint(
        x: wp.array[vec3],
        v: wp.array[vec3],
        w: wp.array[real],
        k: real,
        wind: vec3,
        wind_half: vec3,
        gravity: vec3,
        dt: real,
    ):
        i = wp.tid()
        v0 = v[i]
        rate = k * w[i]

        # Explicit midpoint, with the wind at the start and in the middle of the step.
        v_half = v0 + ((wind - v0) * rate + gravity) * (dt * real(0.5))
        x[i] = x[i] + v_half * dt
        v[i] = v0 + ((wind_half - v_half) * rate + gravity) * dt

    return SimpleNamespace(real=real, vec3=vec3, drag=drag, integrate=integrate, midpoint=midpoint)


@wp.kernel
def emit(
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    start: wp.array[float],
    time: float,
    dt: float,
    step: int,
    jets: int,
    speed: float,
):
    """Send every particle that lies in the basin back through its jet.

    Jet 0 points up; the others stand on a ring around it and lean outwards.
    """
    i = wp.tid()
    if x[i][1] >= 0.0 or time < start[i]:
        return

    state = wp.rand_init(step, i)
    ring = 0.0
    lean = 0.0
    power = 1.0
    heading = 0.0
    jet = i % jets
    if jet > 0:
        heading = wp.TAU * float(jet) / float(jets - 1)
        ring = 1.2
        lean = 0.35
        power = 0.8

    outwards = wp.vec3(wp.cos(heading), 0.0, wp.sin(heading))
    scatter = wp.vec3(wp.randn(state), wp.randn(state), wp.randn(state))
    up = wp.vec3(0.0, 1.0, 0.0)
    aim = up * wp.cos(lean) + outwards * wp.sin(lean)
    nozzle = outwards * ring + wp.vec3(scatter[1], 0.0, scatter[0]) * 0.02
    leave = (aim + scatter * 0.025) * (speed * power)
    # Droplets leave at any moment of the step, not all at its start.
    x[i] = nozzle + leave * (dt * wp.randf(state))
    v[i] = leave


def exact_flight(x0, v0, rate, wind, gust, gravity, t):
    """Position and velocity after `t` seconds of flight with linear drag.

    With c = rate and o = gust, the forced motion is

        p'(t) = gravity / c + wind (c^2 cos(o t) + c o sin(o t)) / (c^2 + o^2)

    and what the start adds to it decays as e^(-c t):

        v(t) = p'(t) + (v0 - p'(0)) e^(-c t)
        x(t) = x0 + p(t) - p(0) + (v0 - p'(0)) (1 - e^(-c t)) / c

    Args:
        x0, v0: start, shape (n, 3), float64 [m, m/s].
        rate: drag per particle k w, shape (n,) [1/s].
        wind: amplitude of the wind, shape (3,) [m/s]; `gust` its frequency [rad/s].
        gravity: shape (3,) [m/s^2].
        t: time [s].
    """
    c = np.asarray(rate, dtype=np.float64)[:, None]
    wind, gravity = np.asarray(wind), np.asarray(gravity)
    share = c / (c * c + gust * gust)
    excess = v0 - gravity / c - wind * share * c
    # sin(o t) / o, also for o = 0
    swing = t * np.sinc(gust * t / np.pi)
    forced = gravity / c * t + wind * share * (c * swing + 1.0 - np.cos(gust * t))
    x = x0 + forced - excess * np.expm1(-c * t) / c
    push = wind * share * (c * np.cos(gust * t) + gust * np.sin(gust * t))
    v = gravity / c + push + excess * np.exp(-c * t)
    return x, v
