"""A free rigid body about its intermediate axis (Dzhanibekov), against elliptic functions."""

import functools

import numpy as np

import warp as wp
import warp.report as report

#: Principal moments, and a spin close to the separatrix: 3 SPIN[2]^2 is little above SPIN[0]^2, so
#: the body dwells near its middle axis and turns over in between.
MOMENTS = np.array([1.0, 2.0, 3.0])
SPIN = np.array([np.sqrt(3.0) * (1.0 - 1e-4), 0.0, 1.0])
BODIES = 1024


@functools.cache
def make_body(real, method):
    """Steps of Euler's equations and of the orientation by the exponential map."""
    vec3 = wp.types.vector(3, real)
    quat = wp.types.quaternion(real)

    @wp.func
    def slope(w: vec3):
        return vec3(
            (real(2.0) - real(3.0)) * w[1] * w[2],
            (real(3.0) - real(1.0)) / real(2.0) * w[2] * w[0],
            (real(1.0) - real(2.0)) / real(3.0) * w[0] * w[1],
        )

    @wp.func
    def rk4(w: vec3, dt: real):
        h = real(0.5) * dt
        a = slope(w)
        b = slope(w + a * h)
        c = slope(w + b * h)
        d = slope(w + c * dt)
        return w + (a + (b + c) * real(2.0) + d) * (dt / real(6.0))

    @wp.func
    def midpoint(w: vec3, dt: real):
        return w + slope(w + slope(w) * (real(0.5) * dt)) * dt

    step = rk4 if method == "rk4" else midpoint

    @wp.kernel
    def tumble(w: wp.array(dtype=vec3), q: wp.array(dtype=quat), dt: real, steps: int):
        i = wp.tid()
        wi, qi = w[i], q[i]
        for _ in range(steps):
            after = step(wi, dt)
            mean = (wi + after) * real(0.5)
            angle = wp.length(mean) * dt
            qi = qi * wp.quat_from_axis_angle(wp.normalize(mean), angle)
            wi = after
        w[i] = wi
        q[i] = qi

    return tumble


def jacobi_elliptic(u, m):
    """sn, cn, dn of argument u and parameter m < 1 by descending Landen steps (A&S 16.4)."""
    means, gaps, lower = [1.0], [np.sqrt(m)], np.sqrt(1.0 - m)
    while gaps[-1] > 1e-17 and len(means) < 40:
        upper = means[-1]
        means.append(0.5 * (upper + lower))
        gaps.append(0.5 * (upper - lower))
        lower = np.sqrt(upper * lower)
    phase = 2.0 ** (len(means) - 1) * means[-1] * u
    for mean, gap in zip(means[:0:-1], gaps[:0:-1]):
        phase = 0.5 * (phase + np.arcsin(gap / mean * np.sin(phase)))
    sn = np.sin(phase)
    return sn, np.cos(phase), np.sqrt(1.0 - m * sn * sn)


def exact(case):
    """Spin at the end (Landau and Lifshitz, Mechanics, section 37; |L|^2 > 2 E I2)."""
    i1, i2, i3 = MOMENTS
    energy2 = (MOMENTS * SPIN**2).sum()
    momentum2 = ((MOMENTS * SPIN) ** 2).sum()
    low, high = energy2 * i3 - momentum2, momentum2 - energy2 * i1
    rate = np.sqrt((i3 - i2) * high / (i1 * i2 * i3))
    m = (i2 - i1) * low / ((i3 - i2) * high)
    sn, cn, dn = jacobi_elliptic(rate * steps_of(case) * case.dt, m)
    sizes = low / (i1 * (i3 - i1)), low / (i2 * (i3 - i2)), high / (i3 * (i3 - i1))
    return {"spin": np.sqrt(sizes) * np.array([cn, sn, dn])}


def steps_of(case):
    return max(1, round(case.time / case.dt))


@report.scene(
    sweep=report.Sweep("dt", 1e-1, 1e-3, 7, quick=4),
    curves=(report.Sweep("method", values=("midpoint", "rk4")),),
    reference=report.Exact(exact, error=1e-12),
    time=20.0,
)
def dzhanibekov(case):
    """1024 bodies that turn over again and again; spin against elliptic functions, |q|, energy."""
    kernel = make_body(case.real, case.method)
    quat = wp.types.quaternion(case.real)
    steps = steps_of(case)
    spins = np.tile(SPIN, (BODIES, 1))
    turned = np.tile((0.0, 0.0, 0.0, 1.0), (BODIES, 1))
    first = [
        wp.array(spins, dtype=case.vec3, device=case.device),
        wp.array(turned, dtype=quat, device=case.device),
    ]
    w, q = (wp.clone(part) for part in first)

    def reset():
        wp.copy(w, first[0])
        wp.copy(q, first[1])

    def run():
        wp.launch(kernel, BODIES, [w, q, case.dt, steps], device=case.device)

    def quantities():
        spin = w.numpy()[0].astype(np.float64)
        norm = np.linalg.norm(q.numpy()[0].astype(np.float64))
        energy = (MOMENTS * spin**2).sum() / (MOMENTS * SPIN**2).sum() - 1.0
        return {
            "spin": spin,
            "energy": report.Error(abs(float(energy))),
            "quaternion norm": report.Error(abs(float(norm - 1.0))),
        }

    return report.Program(run, quantities, reset, work=BODIES * steps)
