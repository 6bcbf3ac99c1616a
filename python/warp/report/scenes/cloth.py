"""Cloth: a net of springs with heavy masses at its hem."""

import functools

import numpy as np

import warp as wp
import warp.report as report

ROWS, COLUMNS, STEPS = 8, 8, 10
# [s], [m/s^2], [m/N], [kg]
DT, GRAVITY, COMPLIANCE, MASS = 1.0 / 120.0, 9.81, 1e-6, 0.01
# The step's change of velocities, and XPBD's form of the compliance.
FALL, SOFTNESS, REST = GRAVITY * DT, COMPLIANCE / DT**2, 1.0 / (ROWS - 1)


@functools.cache
def make_kernels(real):
    """XPBD on a grid of particles; constraints that share no particle are solved at once."""
    vec3 = wp.types.vector(3, real)

    @wp.kernel
    def predict(
        x: wp.array2d(dtype=vec3),
        v: wp.array2d(dtype=vec3),
        before: wp.array2d(dtype=vec3),
        multipliers: wp.array3d(dtype=real),
    ):
        i, j = wp.tid()
        before[i, j] = x[i, j]
        multipliers[0, i, j] = real(0.0)
        multipliers[1, i, j] = real(0.0)
        if i > 0:
            v[i, j] -= vec3(real(0.0), real(0.0), real(FALL))
            x[i, j] += v[i, j] * real(DT)

    @wp.kernel
    def relax(
        x: wp.array2d(dtype=vec3),
        weights: wp.array(dtype=real),
        along: int,
        color: int,
        multipliers: wp.array3d(dtype=real),
    ):
        """Springs to the next row (`along` 0) or column; every second one."""
        a, b = wp.tid()
        i = wp.where(along == 0, 2 * a + color, a)
        j = wp.where(along == 0, b, 2 * b + color)
        p, q = wp.where(along == 0, i + 1, i), wp.where(along == 0, j, j + 1)
        if p >= x.shape[0] or q >= x.shape[1]:
            return
        d = x[p, q] - x[i, j]
        soft = real(SOFTNESS)
        weight = weights[i] + weights[p]
        if weight == real(0.0):
            return
        stretch = wp.length(d) - real(REST)
        change = -(stretch + soft * multipliers[along, i, j]) / (weight + soft)
        multipliers[along, i, j] += change
        push = change * wp.normalize(d)
        x[i, j] -= weights[i] * push
        x[p, q] += weights[p] * push

    @wp.kernel
    def settle(
        x: wp.array2d(dtype=vec3), before: wp.array2d(dtype=vec3), v: wp.array2d(dtype=vec3)
    ):
        i, j = wp.tid()
        v[i, j] = (x[i, j] - before[i, j]) / real(DT)

    return predict, relax, settle


def masses(case):
    found = np.full(ROWS, MASS)
    found[-1] *= case.mass_ratio
    return found


def heights(case):
    """At rest a spring is longer by the weight below it times its compliance."""
    below = np.cumsum(masses(case)[::-1])[::-1][1:]
    return -np.concatenate([[0.0], np.cumsum(REST + below * GRAVITY * COMPLIANCE)])


@report.scene(
    sweep=report.Sweep("iterations", values=(3, 10, 30, 100, 300, 1000), quick=4),
    curves=(report.Sweep("mass_ratio", values=(1.0, 30.0, 1000.0), quick=3),),
    reference=report.Exact(lambda case: {"sag": np.repeat(heights(case), COLUMNS)}, error=1e-15),
    diverged=100.0,
)
def cloth(case):
    """A cloth at rest whose hem weighs up to 1000 times as much: how XPBD lets it sag."""
    predict, relax, settle = make_kernels(case.real)
    grid = (ROWS, COLUMNS)
    start = np.zeros((*grid, 3))
    start[..., 0], start[..., 2] = np.arange(COLUMNS) * REST, heights(case)[:, None]
    first = wp.array(start, dtype=case.vec3, device=case.device)
    x, before, v = (wp.zeros_like(first) for _ in range(3))
    weights = 1.0 / masses(case)
    weights[0] = 0.0
    weights = wp.array(weights, dtype=case.real, device=case.device)
    multipliers = wp.zeros((2, *grid), dtype=case.real, device=case.device)
    half = ((ROWS // 2, COLUMNS), (ROWS, COLUMNS // 2))

    def run():
        for _ in range(STEPS):
            wp.launch(predict, grid, [x, v, before, multipliers], device=case.device)
            for _k in range(int(case.iterations)):
                for along in (0, 1):
                    for color in (0, 1):
                        inputs = [x, weights, along, color, multipliers]
                        wp.launch(relax, half[along], inputs, device=case.device)
            wp.launch(settle, grid, [x, before, v], device=case.device)

    def reset():
        wp.copy(x, first)
        v.zero_()

    def quantities():
        return {"sag": x.numpy()[..., 2].reshape(-1).astype(np.float64)}

    return report.Program(run, quantities, reset, work=ROWS * COLUMNS * STEPS)
