"""Skies as tables over azimuth and height: colours, pictures, and single scattering in air.

T. Nishita et al., Display of the Earth taking into account atmospheric scattering, SIGGRAPH 1993.
"""

import math

import numpy as np

import warp as wp

ROWS, COLUMNS = 128, 256
GROUND, TOP = wp.constant(6360.0), wp.constant(6420.0)
RAYLEIGH = wp.constant(wp.vec3(5.8e-3, 13.5e-3, 33.1e-3))
OZONE = wp.constant(wp.vec3(0.65e-3, 1.88e-3, 0.085e-3))
MIE = wp.constant(4.0e-3)


@wp.func
def to_shell(x: wp.vec3, dir: wp.vec3, radius: float):
    """Distance [km] to a shell around the Earth's centre from inside it."""
    b = wp.dot(x, dir)
    return -b + wp.sqrt(wp.max(0.0, b * b - wp.dot(x, x) + radius * radius))


@wp.func
def optical_depth(x: wp.vec3, dir: wp.vec3, haze: float):
    """Extinction along a ray to the end of the air."""
    last = to_shell(x, dir, TOP)
    depth = wp.vec3()
    for k in range(24):
        # Samples lie close where the air is dense.
        a = float(k) / 24.0
        b = float(k + 1) / 24.0
        p = x + dir * (last * 0.5 * (a * a + b * b))
        h = wp.max(0.0, wp.length(p) - GROUND)
        air = wp.exp(-h / 8.0)
        dust = wp.exp(-h / 1.2)
        ozone = wp.max(0.0, 1.0 - wp.abs(h - 25.0) / 15.0)
        step = last * (b * b - a * a)
        depth += (RAYLEIGH * air + wp.vec3(1.1 * MIE * haze * dust) + OZONE * ozone) * step
    return depth


@wp.func
def falloff(depth: wp.vec3):
    return wp.vec3(wp.exp(-depth[0]), wp.exp(-depth[1]), wp.exp(-depth[2]))


@wp.kernel(enable_backward=False)
def scatter_air(
    sun: wp.vec3, power: float, haze: float, ground: wp.vec3, table: wp.array2d(dtype=wp.vec3)
):
    """Radiance of the air; z is up."""
    i, j = wp.tid()
    height = (float(i) + 0.5) / float(table.shape[0]) * 3.14159265
    turn = ((float(j) + 0.5) / float(table.shape[1]) - 0.5) * 6.2831853
    # Below the horizon the table repeats it, darkened by the ground's colour.
    level = wp.max(wp.cos(height), 0.005)
    flat = wp.sqrt(1.0 - level * level)
    dir = wp.vec3(flat * wp.cos(turn), flat * wp.sin(turn), level)
    x = wp.vec3(0.0, 0.0, GROUND + 0.05)
    last = to_shell(x, dir, TOP)
    mu = wp.dot(dir, sun)
    phase_air = 0.0596831 * (1.0 + mu * mu)
    g = 0.76
    d = 1.0 + g * g - 2.0 * g * mu
    phase_dust = 0.1193662 * (1.0 - g * g) * (1.0 + mu * mu) / ((2.0 + g * g) * d * wp.sqrt(d))
    total = wp.vec3()
    depth = wp.vec3()
    for k in range(48):
        a = float(k) / 48.0
        b = float(k + 1) / 48.0
        step = last * (b * b - a * a)
        p = x + dir * (last * 0.5 * (a * a + b * b))
        h = wp.max(0.0, wp.length(p) - GROUND)
        air = RAYLEIGH * wp.exp(-h / 8.0)
        dust = MIE * haze * wp.exp(-h / 1.2)
        ozone = OZONE * wp.max(0.0, 1.0 - wp.abs(h - 25.0) / 15.0)
        half = (air + wp.vec3(1.1 * dust) + ozone) * (0.5 * step)
        depth += half
        lit = falloff(depth + optical_depth(p, sun, haze))
        # A tenth of what is scattered arrives again, from everywhere.
        again = falloff(depth) * (0.1 * 0.0795775 * wp.max(0.0, sun[2] + 0.1))
        total += wp.cw_mul(lit, air * phase_air + wp.vec3(dust * phase_dust)) * step
        total += wp.cw_mul(again, air + wp.vec3(dust)) * step
        depth += half
    color = total * power
    if wp.cos(height) < 0.0:
        color = wp.cw_mul(color, ground)
    table[i, j] = color


def table_of_air(sun, power, haze, ground, device):
    """The sky's table for a sun, given in its frame (z up), and the sun's irradiance."""
    table = wp.zeros((ROWS, COLUMNS), dtype=wp.vec3, device=device)
    inputs = [wp.vec3(*sun), power, haze, wp.vec3(*ground)]
    wp.launch(scatter_air, table.shape, inputs, [table], device=device)
    return table, power * np.exp(-_sun_depth(sun, haze))


def _sun_depth(sun, haze):
    """Extinction of the direct sunlight, in double precision."""
    x, sun = np.array([0.0, 0.0, 6360.05]), np.asarray(sun, float)
    b = x @ sun
    last = -b + math.sqrt(max(0.0, b * b - x @ x + 6420.0**2))
    edges = np.linspace(0.0, 1.0, 257) ** 2 * last
    middle = 0.5 * (edges[1:] + edges[:-1])
    h = np.maximum(0.0, np.linalg.norm(x + middle[:, None] * sun, axis=1) - 6360.0)
    layers = np.maximum(0.0, 1.0 - np.abs(h - 25.0) / 15.0)
    step = np.diff(edges)
    air, dust = (np.exp(-h / 8.0) * step).sum(), (np.exp(-h / 1.2) * step).sum()
    rayleigh, ozone = np.array([5.8e-3, 13.5e-3, 33.1e-3]), np.array([0.65e-3, 1.88e-3, 0.085e-3])
    return rayleigh * air + 1.1 * 4.0e-3 * haze * dust + ozone * (layers * step).sum()


def table_of_colors(top, horizon, ground, device):
    """A sky between two colours, over a ground of one."""
    height = np.cos((np.arange(ROWS) + 0.5) / ROWS * np.pi)
    mix = np.clip(height, 0.0, 1.0)[:, None] ** 0.5
    rows = np.where(height[:, None] > 0.0, (1.0 - mix) * horizon + mix * top, ground)
    return wp.array(rows[:, None, :].astype(np.float32), dtype=wp.vec3, device=device)
