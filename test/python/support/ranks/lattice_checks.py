"""Checks of a lattice Boltzmann method: only populations that cross a face travel."""

import checking
import numpy as np

import warp as wp
import warp.distributed as wd

# D3Q19: rest, 6 faces, 12 edges.
C = np.array([c for c in np.ndindex(3, 3, 3) if sum(abs(np.array(c) - 1)) <= 2]) - 1
W = np.array([{0: 1 / 3, 1: 1 / 18, 2: 1 / 36}[abs(c).sum()] for c in C], np.float32)
_Ints = wp.types.vector(19, wp.int32)
_Floats = wp.types.vector(19, wp.float32)
CX, CY, CZ = (wp.constant(_Ints(*map(int, C[:, k]))) for k in range(3))
WEIGHT = wp.constant(_Floats(*map(float, W)))


@wp.kernel
def stream_collide(
    f: wp.array4d(dtype=float), first: wp.vec3i, omega: float, g: wp.array4d(dtype=float)
):
    i, j, k = wp.tid()
    i = i + first[0]
    j = j + first[1]
    k = k + first[2]
    h = _Floats()
    rho = float(0.0)
    ux = float(0.0)
    uy = float(0.0)
    uz = float(0.0)
    for q in range(19):
        v = f[q, i - CX[q], j - CY[q], k - CZ[q]]
        h[q] = v
        rho += v
        ux += float(CX[q]) * v
        uy += float(CY[q]) * v
        uz += float(CZ[q]) * v
    ux = ux / rho
    uy = uy / rho
    uz = uz / rho
    square = 1.5 * (ux * ux + uy * uy + uz * uz)
    for q in range(19):
        cu = 3.0 * (float(CX[q]) * ux + float(CY[q]) * uy + float(CZ[q]) * uz)
        e = WEIGHT[q] * rho * (1.0 + cu + 0.5 * cu * cu - square)
        g[q, i, j, k] = h[q] + omega * (e - h[q])


def lattice(comm):
    """Bits of the populations, and mass, after steps with the halo beside the interior."""
    shape, steps = (12, 8, 8), 8
    blocks = wd.Blocks(shape, periodic=True, comm=comm)
    start = np.random.default_rng(1).random((19, *shape)).astype(np.float32)
    start = W[:, None, None, None] * (1 + 0.05 * start)
    f, g = blocks.zeros(items=19), blocks.zeros(items=19)
    blocks.scatter(start if comm.rank == 0 else None, f)
    for _ in range(steps):
        with blocks.overlap(f, items=C):
            box = blocks.interior
            wp.launch(stream_collide, box.shape, [f, wp.vec3i(*box.start), 1.6, g])
        for box in blocks.shell:
            wp.launch(stream_collide, box.shape, [f, wp.vec3i(*box.start), 1.6, g])
        f, g = g, f
    exchange = blocks._exchange("halo", (f,), C)
    for side in exchange.sides:
        # Five populations cross a face, one an edge, none a corner.
        assert len(side.give) in (5, 1)
    whole = blocks.gather(f)
    if comm.rank:
        return None
    assert np.isclose(whole.sum(dtype=float), start.sum(dtype=float), rtol=1e-6)
    reference = start.astype(float)
    for _ in range(steps):
        h = np.stack([np.roll(reference[q], tuple(C[q]), (0, 1, 2)) for q in range(19)])
        rho = h.sum(0)
        u = np.einsum("qd,qxyz->dxyz", C, h) / rho
        cu = 3 * np.einsum("qd,dxyz->qxyz", C, u)
        e = W.astype(float)[:, None, None, None] * rho
        reference = h + 1.6 * (e * (1 + cu + cu * cu / 2 - 1.5 * (u * u).sum(0)) - h)
    assert np.abs(whole - reference).max() < 1e-5
    return checking.digest(whole)


CHECKS = [lattice]
