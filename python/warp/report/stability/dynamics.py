"""Springs, kinetics, diffusion and contact: D1 to D8, D14, D16 to D19."""

import functools

import numpy as np

import warp as wp
from warp.report.stability._case import case

BOTH = ("float32", "float64")


def spring_kernels(real):
    from warp.report._scene import registered

    return registered()["springs"].build.__globals__["make_kernels"](real)


@functools.cache
def make_implicit(real):
    @wp.kernel
    def implicit(x: wp.array(dtype=real), v: wp.array(dtype=real), k: real, h: real):
        # Both divided by what they have in common: nothing cancels.
        i = wp.tid()
        a, b = x[i], v[i]
        scale = real(1.0) + k * h * h
        x[i] = (a + h * b) / scale
        v[i] = (b - k * h * a) / scale

    return implicit


def phase_plane(p, kernel, stiffness, dt, steps):
    """Amplitude over its start after each of `steps`, of 64 springs; the worst of each step."""
    angle = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    x, v = p.array(np.cos(angle)), p.array(np.sin(angle) * np.sqrt(stiffness))

    def size():
        w = v.numpy().astype(np.float64) / np.sqrt(stiffness)
        return np.hypot(x.numpy().astype(np.float64), w)

    sizes = [size()]
    for _ in range(steps):
        p.launch(kernel, 64, x, v, stiffness, dt)
        sizes.append(size())
    return np.array(sizes) / sizes[0]


@case("D1", "implicit Euler on stiff springs: damping 1 / sqrt(1 + k h^2) a step", BOTH)
def stiff_springs(p):
    h = 1.0 / 60.0
    for k in (1e2, 1e6, 1e10):
        size = phase_plane(p, make_implicit(p.real), k, h, 200)
        exact = 1.0 / np.sqrt(1.0 + k * h * h)
        p.check(f"damping of one step, k = {k:g}", np.abs(size[1] / exact - 1).max(), 4 * p.u)
        p.check(f"growth in 200 steps, k = {k:g}", np.diff(size.max(1)).max().clip(0), 0.0)


@case("D2", "symplectic Euler on both sides of h = 2 / sqrt(k)", BOTH)
def stability_limit(p):
    kernel = spring_kernels(p.real)["symplectic"]
    for k in (1e2, 1e6, 1e10):
        limit = 2.0 / np.sqrt(k)
        size = phase_plane(p, kernel, k, 0.99 * limit, 200)
        p.check(f"k = {k:g}, 0.99: largest amplitude", size.max(), 20.0)
        size = phase_plane(p, kernel, k, 1.01 * limit, 200).max(1)
        half = 2 * 1.01**2 - 1
        factor = half + np.sqrt(half * half - 1)
        p.check(f"k = {k:g}, 1.01: growth of a step", size[150] / size[149] / factor - 1, 1e-4)
        p.holds(f"k = {k:g}, 1.01: diverges in numbers", np.isfinite(size) & (size[-1] > 1e12))

    def overflow():
        wp.config.verify_fp = True
        try:
            phase_plane(p, kernel, 1e2, 0.2 * 1e4, 100)
        finally:
            wp.config.verify_fp = False

    p.diagnosed("overflow under verify_fp", overflow, "symplectic", "not finite")


@functools.cache
def make_hanging(real):
    @wp.kernel
    def settle(start: real, k: real, g: real, steps: int, out: wp.array(dtype=real)):
        # Damped relaxation to the rest position: x <- x + (g - k x) / (2 k).
        x = start
        for _ in range(steps):
            x += (g - k * (x - start)) / (real(2.0) * k)
        out[0] = x - start

    return settle


@case("D3", "a spring of 1e10 N/m under gravity: its stretch is below the last digit of 1", BOTH)
def invisible_stretch(p):
    exact, out = 9.81e-10, p.zeros(1)
    p.launch(make_hanging(p.real), 1, 0.0, 1e10, 9.81, 100, out)
    p.check("displacement as the state", out.numpy()[0] / exact - 1, 1e-5)
    p.launch(make_hanging(p.real), 1, 1.0, 1e10, 9.81, 100, out)
    error = abs(out.numpy()[0] / exact - 1)
    if np.spacing(np.array(1.0, p.dtype)) > 0.1 * exact:
        text = f"error {error:.2g}: 1 + {exact:g} is not representable; keep displacements"
        p.explained("position as the state", text)
    else:
        p.check("position as the state", error, 1e-5)


@functools.cache
def make_chain(real):
    @wp.kernel
    def hang(
        x: wp.array(dtype=real), v: wp.array(dtype=real), before: wp.array(dtype=real),
        force: wp.array(dtype=real), substeps: int, iterations: int, h: real, compliance: real,
    ):  # fmt: skip
        for _ in range(substeps):
            for i in range(1, x.shape[0]):
                before[i] = x[i]
                force[i] = real(0.0)
                v[i] += real(9.81) * h
                x[i] += v[i] * h
            for _k in range(iterations):
                for i in range(1, x.shape[0]):
                    w = wp.where(i == 1, real(0.0), real(1.0))
                    stretch = x[i] - x[i - 1] - real(0.1)
                    soft = compliance / (h * h)
                    change = (-stretch - soft * force[i]) / (w + real(1.0) + soft)
                    force[i] += change
                    x[i] += change
                    x[i - 1] -= w * change
            for i in range(1, x.shape[0]):
                v[i] = (x[i] - before[i]) / h

    return hang


@case("D4", "XPBD: substeps with one iteration against one step with as many iterations")
def small_steps(p):
    worst = {}
    for substeps, iterations in ((32, 1), (1, 32)):
        x = p.array(0.1 * np.arange(31))
        state = [p.zeros(31) for _ in range(3)]
        errors = []
        for _ in range(60):
            h = 1.0 / 60.0 / substeps
            p.launch(make_chain(p.real), 1, x, *state, substeps, iterations, h, 1e-10)
            errors.append(np.abs(np.diff(x.numpy()) - 0.1).max())
        worst[substeps] = max(errors)
    p.check("constraint error of substeps over that of iterations", worst[32] / worst[1], 0.5)
    p.note("constraint errors [m]", f"{worst[32]:.2e} and {worst[1]:.2e}")


@functools.cache
def make_stiff_scalar(real):
    @wp.kernel
    def solve(rate: real, h: real, steps: int, middle: bool, out: wp.array(dtype=real)):
        y = real(0.0)
        for n in range(steps):
            if middle:
                t = (real(n) + real(0.5)) * h
                slope = (wp.cos(t) + rate * (y - wp.sin(t))) / (real(1.0) - real(0.5) * h * rate)
                y += h * slope
            else:
                t = real(n + 1) * h
                y = (y + h * (wp.cos(t) - rate * wp.sin(t))) / (real(1.0) - h * rate)
        out[0] = y

    return solve


@case("D5", "Prothero and Robinson's problem, lambda = -1e6: order reduction as predicted")
def prothero_robinson(p):
    for middle, exact in ((False, 4.114e-8), (True, 1.053e-3)):
        out = p.zeros(1)
        p.launch(make_stiff_scalar(p.real), 1, -1e6, 0.1, 10, middle, out)
        error = abs(out.numpy()[0] - np.sin(1.0))
        name = "implicit midpoint" if middle else "implicit Euler"
        p.check(f"{name}: error over the one predicted", error / exact - 1, 1e-3)


@case("D6", "van der Pol's oscillator, mu = 1e6, to t = 1")
def van_der_pol(p):
    p.scene("van_der_pol", {"state": 9e5 * p.u}, tolerance=1e-10)


@case("D7", "Robertson's kinetics: species from 1e-5 to 1, mass conserved", BOTH)
def robertson(p):
    limits = {"species": 1e-3, "mass": 10 * p.u * 1280}
    p.scene("robertson", limits, steps=1280, method="SDIRK2")


@case("D14", "tension of two rods for mass ratios 1 to 1e6, the heavy end below")
def mass_ratios(p):
    for ratio in (1.0, 100.0, 1000.0):
        for iterations in (10, 100, 1000, 10000, 100000):
            found = p.scene("hanging_masses", {}, mass_ratio=ratio, iterations=iterations)
            p.checks.pop()
            if found["errors"].get("tension", np.inf) < 1e-3:
                break
        p.check(f"tension at ratio {ratio:g}", found["errors"]["tension"], 1e-3)
        p.note(f"iterations at ratio {ratio:g}", iterations)


@functools.cache
def make_stack(real):
    @wp.kernel
    def rest(v: wp.array(dtype=real), gap: wp.array(dtype=real), push: wp.array(dtype=real),
             h: real, steps: int, top: wp.array(dtype=real)):  # fmt: skip
        # Boxes of mass 1 on each other: projected Gauss-Seidel, warm started.
        n = v.shape[0]
        for _ in range(steps):
            for i in range(n):
                above = real(0.0)
                if i + 1 < n:
                    above = push[i + 1]
                v[i] += real(-9.81) * h + push[i] - above
            for _k in range(20):
                for i in range(n):
                    below, inverse = real(0.0), real(1.0)
                    if i > 0:
                        below, inverse = v[i - 1], real(2.0)
                    goal = -wp.max(gap[i], real(0.0)) / h
                    change = (goal - (v[i] - below)) / inverse
                    change = wp.max(change, -push[i])
                    push[i] += change
                    v[i] += change
                    if i > 0:
                        v[i - 1] -= change
            speed = real(0.0)
            for i in range(n):
                below = real(0.0)
                if i > 0:
                    below = v[i - 1]
                gap[i] += (v[i] - below) * h
                speed = wp.max(speed, wp.abs(v[i]))
            top[0] = speed

    return rest


@case("D16", "20 boxes at rest on each other for 1000 s", BOTH)
def stack(p):
    v, gap, push, top = p.zeros(20), p.zeros(20), p.zeros(20), p.zeros(1)
    h = 1.0 / 60.0
    p.launch(make_stack(p.real), 1, v, gap, push, h, 60_000, top)
    p.check("speed [m/s]", top.numpy()[0], 1e-4)
    p.check("penetration [m]", -gap.numpy().min().clip(None, 0), 9.81 * h * h)
    weights = 9.81 * h * np.arange(20, 0, -1)
    p.check("weights carried", np.abs(push.numpy() / weights - 1).max(), 1e-3)


@case("D17", "blocks at the edge of the friction cone, and without friction", BOTH)
def friction_cone(p):
    for mu in (0.0, 0.3, 0.9):
        p.scene("slope", {"distance": 2e-3, "creep": 0.0}, mu=mu, dt=1e-3)
