"""A grid of the voxels of a spherical shell by `wp.Volume`, as voxels.cpp builds it by NanoVDB.

voxels.py [--threads 1]
"""

import argparse
import time

import numpy as np

import warp as wp

RADIUS = 180


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--threads", type=int, default=1)
    wp.config.num_threads = parser.parse_args().threads
    wp.config.quiet = True
    axis = np.arange(-RADIUS, RADIUS + 1)
    square = axis[:, None, None] ** 2 + axis[None, :, None] ** 2 + axis[None, None, :] ** 2
    shell = (square <= RADIUS**2) & (square > (RADIUS - 2) ** 2)
    voxels = wp.array(np.argwhere(shell).astype(np.int32) - RADIUS, dtype=int, device="cpu")
    times = []
    for _ in range(6):
        start = time.perf_counter()
        wp.Volume.allocate_by_voxels(voxels, voxel_size=1.0, device="cpu")
        times.append(time.perf_counter() - start)
    print(f"{len(voxels)} voxels: {min(times[1:]) * 1e3:.1f} ms")


if __name__ == "__main__":
    main()
