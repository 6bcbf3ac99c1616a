"""A stable neo-Hookean block, compressed and turned inside out, and a hanging chain of masses."""

import functools

import numpy as np

import warp as wp
import warp.report as report

SAMPLES = 1024


@functools.cache
def make_stress(real):
    """First Piola-Kirchhoff stress of the stable neo-Hookean energy, and the energy itself."""
    mat33 = wp.types.matrix((3, 3), real)

    @wp.kernel
    def stress(
        F: wp.array(dtype=mat33),
        mu: real,
        lam: real,
        P: wp.array(dtype=mat33),
        energy: wp.array(dtype=real),
    ):
        i = wp.tid()
        f = F[i]
        squares = wp.ddot(f, f)
        det = wp.determinant(f)
        c0, c1, c2 = f[0], f[1], f[2]
        cofactor = wp.matrix_from_rows(wp.cross(c1, c2), wp.cross(c2, c0), wp.cross(c0, c1))
        alpha = real(1.0) + mu / lam - mu / (real(4.0) * lam)
        P[i] = f * (mu * (real(1.0) - real(1.0) / (squares + real(1.0)))) + cofactor * (
            lam * (det - alpha)
        )
        gap = det - alpha
        energy[i] = real(0.5) * (
            mu * (squares - real(3.0)) + lam * gap * gap - mu * wp.log(squares + real(1.0))
        )

    return stress


def deformations(case):
    """Uniaxial stretches `stretch` with shears that differ from sample to sample."""
    f = np.tile(np.eye(3), (SAMPLES, 1, 1))
    f[:, 0, 0] = case.stretch
    f[:, 0, 1] = np.linspace(0.0, 0.5, SAMPLES)
    return f.astype(case.dtype)


def cofactors(f):
    """Derivatives of the determinants by the entries."""
    a, b, c = f[:, 0], f[:, 1], f[:, 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def exact_stress(case):
    """The same formula in float64 (Smith, de Goes, Kim 2018, equations 13 and 14)."""
    f, mu, lam = deformations(case).astype(np.float64), *moduli(case)
    squares = (f * f).sum(axis=(1, 2))
    det, cofactor = np.linalg.det(f), cofactors(f)
    alpha = 1.0 + mu / lam - mu / (4.0 * lam)
    scale = (mu * (1.0 - 1.0 / (squares + 1.0)))[:, None, None]
    return {"stress": scale * f + (lam * (det - alpha))[:, None, None] * cofactor}


def limit(case):
    """Rounding of the formula, and of the volume where a stiff one nearly cancels."""
    f, lam = deformations(case).astype(np.float64), moduli(case)[1]
    parts = lam * (np.abs(np.linalg.det(f)) + 1.0)[:, None, None] * cofactors(f)
    condition = np.linalg.norm(parts) / np.linalg.norm(exact_stress(case)["stress"])
    return {"stress": 2.0 ** (-24 if case.dtype == "float32" else -53) * (200.0 + 2.0 * condition)}


def moduli(case):
    """Lame moduli from Young's modulus 1 and the Poisson ratio."""
    nu = case.poisson
    return 0.5 / (1.0 + nu), nu / ((1.0 + nu) * (1.0 - 2.0 * nu))


@report.scene(
    sweep=report.Sweep("stretch", values=(2.0, 1.0, 0.5, 0.1, 1e-3, 0.0, -0.5, -1.0), quick=5),
    curves=(report.Sweep("poisson", values=(0.3, 0.49, 0.4999), quick=2),),
    reference=report.Exact(exact_stress, error=1e-15),
    limits=limit,
)
def neo_hookean(case):
    """Stress of 1024 blocks from twice their length through flat to inside out."""
    mat33 = wp.types.matrix((3, 3), case.real)
    f = wp.array(deformations(case), dtype=mat33, device=case.device)
    stress, energy = wp.zeros_like(f), wp.zeros(SAMPLES, dtype=case.real, device=case.device)
    kernel = make_stress(case.real)

    def run():
        wp.launch(kernel, SAMPLES, [f, *moduli(case)], [stress, energy], device=case.device)

    def quantities():
        return {"stress": stress.numpy()}

    return report.Program(run, quantities, work=SAMPLES)


@functools.cache
def make_chain(real):
    """Two masses on inextensible rods under gravity: XPBD with zero compliance, at rest."""

    @wp.kernel
    def relax(ratio: real, dt: real, steps: int, iterations: int, tension: wp.array(dtype=real)):
        i = wp.tid()
        w1, w2 = real(1.0), real(1.0) / ratio
        x1, x2 = real(1.0), real(2.0)
        v1, v2 = real(0.0), real(0.0)
        top, low = real(0.0), real(0.0)
        for _ in range(steps):
            v1 += real(9.81) * dt
            v2 += real(9.81) * dt
            y1, y2 = x1 + v1 * dt, x2 + v2 * dt
            top, low = real(0.0), real(0.0)
            for _k in range(iterations):
                d = -(y1 - real(1.0)) / w1
                y1 += w1 * d
                top += d
                d = -(y2 - y1 - real(1.0)) / (w1 + w2)
                y1 -= w1 * d
                y2 += w2 * d
                low += d
            v1, v2 = (y1 - x1) / dt, (y2 - x2) / dt
            x1, x2 = y1, y2
        tension[2 * i] = -top / (dt * dt)
        tension[2 * i + 1] = -low / (dt * dt)

    return relax


@report.scene(
    sweep=report.Sweep("iterations", values=(10, 30, 100, 300, 1000, 3000), quick=4),
    curves=(report.Sweep("mass_ratio", values=(1.0, 100.0, 1000.0), quick=3),),
    reference=report.Exact(
        lambda case: {
            "tension": 9.81 * np.tile((1.0 + case.mass_ratio, case.mass_ratio), 64),
        },
        error=1e-15,
    ),
    diverged=100.0,
)
def hanging_masses(case):
    """Tension of two rods with the heavy mass below: how slowly an iterative solver finds it."""
    tension = wp.zeros(128, dtype=case.real, device=case.device)
    kernel = make_chain(case.real)

    def run():
        inputs = [case.mass_ratio, 1.0 / 60.0, 10, int(case.iterations), tension]
        wp.launch(kernel, 64, inputs, device=case.device)

    return report.Program(run, lambda: {"tension": tension.numpy()}, work=64 * 10)
