"""Lattice Boltzmann flow past a cylinder on any number of ranks: D2Q9, halo beside the interior.

    python examples/distributed/cylinder.py [--width 200 --height 80 --steps 2000]
    mpirun -n 4 python examples/distributed/cylinder.py

Three populations cross a face and travel; cells that need no ghosts are computed meanwhile. The
picture shows the vorticity, the last line says million lattice updates a second.
"""

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
import warp.distributed as wd

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
C = np.array([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)])
W = np.array([4 / 9] + [1 / 9] * 4 + [1 / 36] * 4)
OPPOSITE = [0, 3, 4, 1, 2, 7, 8, 5, 6]
Ints, Floats = wp.types.vector(9, wp.int32), wp.types.vector(9, wp.float32)
CX, CY = wp.constant(Ints(*map(int, C[:, 0]))), wp.constant(Ints(*map(int, C[:, 1])))
WEIGHT, BACK = wp.constant(Floats(*map(float, W))), wp.constant(Ints(*OPPOSITE))
INFLOW = wp.constant(0.08)


@wp.func
def equilibrium(q: int, rho: float, u: wp.vec2):
    cu = 3.0 * (float(CX[q]) * u[0] + float(CY[q]) * u[1])
    return WEIGHT[q] * rho * (1.0 + cu + 0.5 * cu * cu - 1.5 * wp.dot(u, u))


@wp.kernel
def advance(
    f: wp.array3d[float],
    solid: wp.array2d[wp.uint8],
    first: wp.vec2i,
    offset: wp.vec2i,
    omega: float,
    g: wp.array3d[float],
):
    """Streams, bounces back at the cylinder, collides; the inflow is an equilibrium."""
    a, b = wp.tid()
    i = a + first[0]
    j = b + first[1]
    h = Floats()
    rho = float(0.0)
    u = wp.vec2(0.0, 0.0)
    for q in range(9):
        v = f[q, i - CX[q], j - CY[q]]
        if solid[i - CX[q], j - CY[q]] != wp.uint8(0):
            v = f[BACK[q], i, j]
        h[q] = v
        rho += v
        u += wp.vec2(float(CX[q]), float(CY[q])) * v
    u = u / rho
    inflow = i + offset[0] - 1 == 0
    for q in range(9):
        value = h[q] + omega * (equilibrium(q, rho, u) - h[q])
        if inflow:
            value = equilibrium(q, 1.0, wp.vec2(INFLOW, 0.0))
        g[q, i, j] = value


def simulate(width, height, steps, omega):
    blocks = wd.Blocks((width, height), periodic=True)
    x, y = np.meshgrid(np.arange(width), np.arange(height), indexing="ij")
    body = (x - width / 5) ** 2 + (y - height / 2 - 0.5) ** 2 < (height / 9) ** 2
    solid = blocks.zeros(wp.uint8)
    blocks.scatter(body.astype(np.uint8), solid)
    blocks.halo(solid)
    f, g = blocks.zeros(items=9), blocks.zeros(items=9)
    cu = 3 * C[:, 0] * float(INFLOW)
    start = W * (1 + cu + cu * cu / 2 - 1.5 * float(INFLOW) ** 2)
    f.assign(np.broadcast_to(start[:, None, None], f.shape).astype(np.float32))
    offset = wp.vec2i(*blocks.offset)

    def run(box):
        if box.size:
            wp.launch(advance, box.shape, [f, solid, wp.vec2i(*box.start), offset, omega, g])

    begin = time.perf_counter()
    for _ in wd.progress(range(steps), desc="flow", disable=None):
        with blocks.overlap(f, items=C):
            run(blocks.interior)
        for box in blocks.shell:
            run(box)
        f, g = g, f
    return blocks.gather(f), body, time.perf_counter() - begin


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("width", 200), ("height", 80), ("steps", 2000)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init()
    size = options.width, options.height
    f, body, seconds = simulate(*size, options.steps, 1.0 / 0.53)
    if comm.rank or f is None:
        return
    rho = f.sum(0)
    u = np.einsum("qd,qxy->dxy", C, f) / rho
    vorticity = np.gradient(u[1], axis=0) - np.gradient(u[0], axis=1)
    vorticity[body] = np.nan
    options.output.mkdir(parents=True, exist_ok=True)
    limit = np.nanpercentile(abs(vorticity), 99)
    plt.figure(figsize=(10, 4))
    plt.imshow(vorticity.T, origin="lower", cmap="RdBu", vmin=-limit, vmax=limit)
    plt.title(f"vorticity after {options.steps} steps on {comm.size} rank(s)")
    plt.savefig(options.output / "cylinder.png", dpi=110, bbox_inches="tight")
    updates = size[0] * size[1] * options.steps / seconds / 1e6
    print(f"{comm.size} rank(s): {updates:.1f} MLUPS, largest speed {np.abs(u).max():.4f}")


if __name__ == "__main__":
    main()
