"""Long times: orbits, pendulums, spinning bodies, transport: D9 to D15, D18, D19."""

import functools

import numpy as np

import warp as wp
from warp.report._scene import registered as scenes
from warp.report.stability._case import case

BOTH = ("float32", "float64")


def from_scene(scene, name):
    """A kernel factory of a scene's file."""
    return scenes()[scene].build.__globals__[name]


@functools.cache
def make_approach(real):
    vec2 = wp.types.vector(2, real)

    @wp.func
    def pull(x: vec2):
        r = wp.length(x)
        return -x / (r * r * r)

    @wp.kernel
    def approach(e: wp.array(dtype=real), eta: real, out: wp.array(dtype=vec2)):
        i = wp.tid()
        x = vec2(real(1.0) - e[i], real(0.0))
        v = vec2(real(0.0), wp.sqrt((real(1.0) + e[i]) / (real(1.0) - e[i])))
        t = real(0.0)
        while t < real(1.0):
            r = wp.length(x)
            # A share of the time in which the body would fall to the centre.
            h = wp.min(eta * r * wp.sqrt(r), real(1.0) - t)
            k1 = pull(x)
            v2 = v + k1 * (real(0.5) * h)
            k2 = pull(x + v * (real(0.5) * h))
            v3 = v + k2 * (real(0.5) * h)
            k3 = pull(x + v2 * (real(0.5) * h))
            v4 = v + k3 * h
            k4 = pull(x + v3 * h)
            x += (v + (v2 + v3) * real(2.0) + v4) * (h / real(6.0))
            v += (k1 + (k2 + k3) * real(2.0) + k4) * (h / real(6.0))
            t += h
        out[i] = x

    return approach


@case("D9", "Kepler orbits from the perihelion to t = 1, eccentricity to 0.999")
def close_approach(p):
    e = np.array([0.5, 0.9, 0.99, 0.999])
    out = p.zeros(4, p.vector(2))
    p.launch(make_approach(p.real), 4, p.array(e), 0.002, out)
    anomaly = np.full(4, 1.5)
    for _ in range(50):
        anomaly -= (anomaly - e * np.sin(anomaly) - 1) / (1 - e * np.cos(anomaly))
    exact = np.stack([np.cos(anomaly) - e, np.sqrt(1 - e * e) * np.sin(anomaly)], 1)
    p.check("position", np.abs(out.numpy() - exact).max(1), 1e-8, eccentricity=e)


@case("D11", "energy of a Kepler orbit, eccentricity 0.9: leapfrog bounded, RK4 drifts")
def energy_drift(p):
    periods, per, e = 400, 4000, 0.9
    h = 2 * np.pi / per
    for method in ("leapfrog", "rk4"):
        kernel = from_scene("kepler", "make_orbit")(p.real, method)
        x = p.array([[1 - e, 0.0]], p.vector(2))
        v = p.array([[0.0, np.sqrt((1 + e) / (1 - e))]], p.vector(2))
        energy = p.zeros(periods * per // 100 + 1)
        p.launch(kernel, 1, x, v, h, periods * per, 100, energy)
        error = np.abs(energy.numpy()[1 : periods * per // 100] / -0.5 - 1)
        first, last = error[: error.size // 4].max(), error[-error.size // 4 :].max()
        if method == "leapfrog":
            p.check("leapfrog: late over early error, less 1", last / first - 1, 0.25)
        else:
            p.note("RK4: drift of an orbit", float(error[-1] / periods))


@case("D13", "a double pendulum forward and back: where it began, energy kept")
def reversal(p):
    kernel = from_scene("double_pendulum", "make_pendulum")(p.real, "implicit midpoint")
    energy = from_scene("double_pendulum", "pendulum_energy")
    first = np.array([[np.pi / 2, np.pi / 2 + 0.01 * k, 0.0, 0.0] for k in range(16)])
    state = p.array(first, p.vector(4))
    p.launch(kernel, 16, state, 1e-3, 4000)
    p.check("energy", np.abs(energy(state.numpy()) - energy(first)).max() / 29.43, 1e-4)
    p.launch(kernel, 16, state, -1e-3, 4000)
    # Growth by the Lyapunov exponent, below 5 / s, over 8 s of steps that each round.
    p.check("back at the start", np.abs(state.numpy() - first).max(), 1e-6)


@functools.cache
def make_free_body(real):
    vec3 = wp.types.vector(3, real)

    @wp.kernel
    def spin(moments: vec3, h: real, steps: int, momentum: wp.array(dtype=vec3),
             turned: wp.array(dtype=wp.types.quaternion(real))):  # fmt: skip
        # The momentum in the body's frame by RK4, its increments compensated.
        m, lost, q = momentum[0], vec3(), turned[0]
        for _ in range(steps):
            k1 = wp.cross(m, wp.cw_div(m, moments))
            m2 = m + k1 * (real(0.5) * h)
            k2 = wp.cross(m2, wp.cw_div(m2, moments))
            m3 = m + k2 * (real(0.5) * h)
            k3 = wp.cross(m3, wp.cw_div(m3, moments))
            m4 = m + k3 * h
            k4 = wp.cross(m4, wp.cw_div(m4, moments))
            change = (k1 + (k2 + k3) * real(2.0) + k4) * (h / real(6.0)) + lost
            after = m + change
            lost = change - (after - m)
            m = after
            q = wp.normalize(q * wp.quat_exp(wp.cw_div(m2, moments) * h))
        momentum[0], turned[0] = m, q

    return spin


@case("D15", "a free body about its middle axis for 1e6 steps: |q|, energy, momentum", BOTH)
def free_body(p):
    moments, first = np.array([1.0, 2.0, 3.0]), np.array([0.002, 2.0, 0.001])
    first = first.astype(p.dtype).astype(float)
    m, q = p.array([first], p.vector(3)), p.array([[0.0, 0.0, 0.0, 1.0]], p.quat)
    p.launch(make_free_body(p.real), 1, p.vector(3)(*moments), 1e-3, 1_000_000, m, q)
    after = m.numpy()[0].astype(float)
    p.check("|q| - 1", np.linalg.norm(q.numpy()[0].astype(float)) - 1, 4 * p.u)
    p.check("energy", (after**2 / moments).sum() / (first**2 / moments).sum() - 1, 1e-6)
    p.check("momentum", np.linalg.norm(after) / np.linalg.norm(first) - 1, 1e-6)


@functools.cache
def make_transport(real):
    @wp.func
    def limited(a: real, b: real):
        return wp.where(a * b > real(0.0), wp.where(wp.abs(a) < wp.abs(b), a, b), real(0.0))

    @wp.func
    def flux(u: real, burgers: bool):
        return wp.where(burgers, real(0.5) * u * u, u)

    @wp.kernel
    def advance(u: wp.array(dtype=real), c: real, burgers: bool, out: wp.array(dtype=real)):
        # Upwind with minmod slopes and a midpoint in time (Hancock), for u >= 0.
        i = wp.tid()
        n = u.shape[0]
        a, b, d, e = u[(i + n - 2) % n], u[(i + n - 1) % n], u[i], u[(i + 1) % n]
        left, right = limited(b - a, d - b), limited(d - b, e - d)
        lowb, highb = b - real(0.5) * left, b + real(0.5) * left
        lowd, highd = d - real(0.5) * right, d + real(0.5) * right
        ub = highb - real(0.5) * c * (flux(highb, burgers) - flux(lowb, burgers))
        ud = highd - real(0.5) * c * (flux(highd, burgers) - flux(lowd, burgers))
        out[i] = d - c * (flux(ud, burgers) - flux(ub, burgers))

    return advance


@case("D18", "heat beside its limit; a shock and a top hat: no overshoot, nothing lost", BOTH)
def transport(p):
    if p.dtype == "float64":
        for cfl in (0.45, 0.5, 0.5001, 0.51):
            p.scene("heat", {}, cfl=cfl)
    for burgers in (False, True):
        n = 200
        x = np.where((np.arange(n) > 50) & (np.arange(n) < 100), 1.0, 0.0)
        x += 0.25 if burgers else 0.0
        u, other = p.array(x), p.zeros(n)
        for _ in range(2 * n):
            p.launch(make_transport(p.real), n, u, 0.5, burgers, other)
            u, other = other, u
        found, name = u.numpy().astype(float), "Burgers" if burgers else "top hat"
        outside = max(found.max() - x.max(), x.min() - found.min(), 0.0)
        p.check(f"{name}: over- and undershoot", outside, 8 * p.u)
        p.check(f"{name}: lost", (found.sum() - x.sum()) / x.sum(), 2 * n * p.u)
        variation = np.abs(np.diff(found, append=found[0])).sum()
        p.check(f"{name}: variation gained", max(variation - 2.0, 0.0), 2 * n * p.u)


@functools.cache
def make_barrier(real):
    @wp.func
    def potential(x: real, y: real, wall: real, near: real):
        total = real(0.0)
        gaps = wp.types.vector(3, real)(x, y - x, wall - y)
        for k in range(3):
            g = gaps[k]
            if g <= real(0.0):
                total += real(1e30)
            elif g < near:
                total -= (g - near) * (g - near) * wp.log(g / near)
        return total

    @wp.kernel
    def squeeze(steps: int, near: real, stiffness: real, least: wp.array(dtype=real)):
        # Two points between a wall at 0 and one that closes in: Newton-free descent whose steps
        # are halved until no gap closes and the potential falls.
        x, y, wall, closest = real(0.3), real(0.6), real(1.0), real(1.0)
        for s in range(steps):
            target = real(1.0) - real(0.99) * real(s + 1) / real(steps)
            wall = wp.max(target, y + real(0.5) * (wall - y))
            for _ in range(60):
                eps = real(1e-7)
                e0 = stiffness * potential(x, y, wall, near)
                gx = (stiffness * potential(x + eps * x, y, wall, near) - e0) / (eps * x)
                gy = (stiffness * potential(x, y + eps * x, wall, near) - e0) / (eps * x)
                size = wp.sqrt(gx * gx + gy * gy) + real(1e-12)
                alpha = real(0.25) * wp.min(wp.min(x, y - x), wall - y) / size
                for _k in range(30):
                    a, b = x - alpha * gx, y - alpha * gy
                    if stiffness * potential(a, b, wall, near) < e0:
                        x, y = a, b
                        break
                    alpha *= real(0.5)
                closest = wp.min(closest, wp.min(wp.min(x, y - x), wall - y))
        least[0] = closest

    return squeeze


@case("D19", "points squeezed by a barrier: no gap ever closes")
def barrier(p):
    least = p.zeros(1)
    p.launch(make_barrier(p.real), 1, 100, 0.1, 1.0, least)
    p.holds("least gap > 0", least.numpy()[0] > 0.0)
    p.note("least gap", float(least.numpy()[0]))
