"""Cholesky factors of many small dense matrices: tile kernels beside cuSOLVER and MAGMA.

    python factors.py [--device cuda:0] [--rows 32,64,96,128] [--systems 1024,8192]

A line for each number of rows and systems has, by form, microseconds for all systems (the least of
five runs of a graph that factors them five times), GFLOP/s at n^3 / 3 each, and the largest error
of L L^T relative to the largest element. `whole` is one tile for a system, up to 96 rows; `blocks
of b` are tile_cholesky, tile_lower_solve and tile_matmul in loops, as physics engines have them,
where b divides the rows. cuSOLVER and MAGMA come from PyTorch, where there is one.
"""

import argparse
import time

import numpy as np

import warp as wp

wp.config.quiet = True
REPEAT = 5
# Systems that differ; the rest are the same again.
DIFFERENT = 64


def whole_kernel(n):
    @wp.kernel(module="unique", enable_backward=False)
    def whole(a: wp.array3d(dtype=float), x: wp.array3d(dtype=float)):
        i = wp.tid()
        wp.tile_store(x[i], wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n))))

    return whole


def blocked_kernel(n, b):
    @wp.kernel(module="unique", enable_backward=False)
    def blocked(a: wp.array3d(dtype=float), x: wp.array3d(dtype=float)):
        i = wp.tid()
        for k in range(0, n, b):
            s = wp.tile_load(a[i], shape=(b, b), offset=(k, k), storage="shared")
            for j in range(0, k, b):
                t = wp.tile_load(x[i], shape=(b, b), offset=(k, j))
                s -= wp.tile_matmul(t, wp.tile_transpose(t))
            low = wp.tile_cholesky(s)
            wp.tile_store(x[i], low, offset=(k, k))
            for r in range(k + b, n, b):
                u = wp.tile_load(a[i], shape=(b, b), offset=(r, k), storage="shared")
                for j in range(0, k, b):
                    p = wp.tile_load(x[i], shape=(b, b), offset=(r, j))
                    q = wp.tile_load(x[i], shape=(b, b), offset=(k, j))
                    u -= wp.tile_matmul(p, wp.tile_transpose(q))
                w = wp.tile_lower_solve(low, wp.tile_transpose(u))
                wp.tile_store(x[i], wp.tile_transpose(w), offset=(r, k))

    return blocked


def time_launch(launch, device):
    """Microseconds of a launch."""
    for _ in range(4):
        launch()
    wp.synchronize_device(device)

    def run():
        for _ in range(REPEAT):
            launch()

    if wp.get_device(device).is_cuda:
        with wp.ScopedCapture(device=device) as capture:
            run()

        def run():
            wp.capture_launch(capture.graph)

    best = float("inf")
    for _ in range(5):
        wp.synchronize_device(device)
        begin = time.perf_counter()
        run()
        wp.synchronize_device(device)
        best = min(best, (time.perf_counter() - begin) / REPEAT)
    return best * 1e6


def time_torch(torch, library, matrices):
    """Microseconds, and the factors, of a library behind PyTorch."""
    torch.backends.cuda.preferred_linalg_library(library)
    for _ in range(3):
        low = torch.linalg.cholesky_ex(matrices)[0]
    best = float("inf")
    for _ in range(5):
        begin, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        begin.record()
        for _ in range(REPEAT):
            low = torch.linalg.cholesky_ex(matrices)[0]
        end.record()
        torch.cuda.synchronize()
        best = min(best, begin.elapsed_time(end) / REPEAT * 1e3)
    return best, low.cpu().numpy()


def forms_of(n):
    """Names, kernels and threads per block."""
    kernels = [("whole", whole_kernel(n))] if n <= 96 else []
    kernels += [(f"blocks of {b}", blocked_kernel(n, b)) for b in (16, 32) if n > b and n % b == 0]
    return [(f"{name}, {t} threads", kernel, t) for name, kernel in kernels for t in (32, 128)]


def compare(n, count, device, torch):
    rng = np.random.default_rng(n)
    root = rng.standard_normal((DIFFERENT, n, n)) / np.sqrt(n)
    few = (root @ root.transpose(0, 2, 1) + np.eye(n)).astype(np.float32)
    data = np.resize(few, (count, n, n))
    a = wp.array(data, dtype=float, device=device)
    x = wp.zeros_like(a)
    print(f"{n} rows, {count} systems")

    def report(name, us, got):
        low = np.tril(got[:DIFFERENT].astype(float))
        error = np.abs(low @ low.transpose(0, 2, 1) - few[: len(low)]).max() / np.abs(few).max()
        rate = count * n**3 / 3 / us / 1e3
        print(f"  {name:<28}{us:>10.1f} us{rate:>8.0f} GFLOP/s  error {error:.0e}", flush=True)

    for name, kernel, threads in forms_of(n):
        us = time_launch(
            lambda k=kernel, t=threads: wp.launch_tiled(
                k, dim=count, inputs=[a, x], block_dim=t, device=device
            ),
            device,
        )
        report(name, us, x.numpy())
    if torch is not None:
        matrices = torch.from_numpy(data).to(str(device))
        for library in ("cusolver", "magma"):
            report(library, *time_torch(torch, library, matrices))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--rows", default="32,64,96,128")
    parser.add_argument("--systems", default="1024,8192")
    options = parser.parse_args()
    device = wp.get_device(options.device)
    torch = None
    if device.is_cuda:
        try:
            import torch
        except ImportError:
            print("no PyTorch: tile kernels alone")
    for n in map(int, options.rows.split(",")):
        for count in map(int, options.systems.split(",")):
            compare(n, count, device, torch)


if __name__ == "__main__":
    main()
