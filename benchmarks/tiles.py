"""Tile programs forward and backward: time of each, their ratio, and the error against float64.

    python tiles.py [--device cpu|cuda:0] [--only NAME,NAME] [--seconds 0.5]

Times are the least of many launches (and their median), of a recorded launch and of the adjoint
launch alone: gradients of outputs are set before, those of inputs are added to. Runs on this
package and on NVIDIA Warp. The aim is a ratio of 2.5 at most.
"""

import argparse
import time

import numpy as np

import warp as wp

rng = np.random.default_rng(3)


def scale(n, tile):
    @wp.kernel(module="unique")
    def kernel(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x, shape=tile, offset=i * tile)
        wp.tile_store(y, t * 2.0 + t, offset=i * tile)

    x = rng.random(n, dtype=np.float32)
    return kernel, n // tile, [x], np.zeros_like(x), lambda x: 3 * x, 128


def softmax(rows, columns):
    @wp.func
    def shifted(a: float, m: float):
        return wp.exp(a - m)

    @wp.kernel(module="unique")
    def kernel(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
        i = wp.tid()
        t = wp.tile_load(x[i], shape=columns)
        e = wp.tile_map(shifted, t, wp.tile_broadcast(wp.tile_max(t), shape=(columns,)))
        wp.tile_store(
            y[i], wp.tile_map(wp.div, e, wp.tile_broadcast(wp.tile_sum(e), shape=(columns,)))
        )

    def reference(x):
        e = np.exp(x - x.max(axis=1, keepdims=True))
        return e / e.sum(axis=1, keepdims=True)

    x = rng.normal(size=(rows, columns)).astype(np.float32)
    return kernel, rows, [x], np.zeros_like(x), reference, 128


def product(n, tile):
    @wp.kernel(module="unique")
    def kernel(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
        i, j = wp.tid()
        total = wp.tile_zeros(shape=(tile, tile), dtype=float)
        for k in range(n // tile):
            x = wp.tile_load(a, shape=(tile, tile), offset=(i * tile, k * tile))
            y = wp.tile_load(b, shape=(tile, tile), offset=(k * tile, j * tile))
            wp.tile_matmul(x, y, total)
        wp.tile_store(c, total, offset=(i * tile, j * tile))

    a, b = (rng.normal(size=(n, n)).astype(np.float32) for _ in range(2))
    return kernel, (n // tile, n // tile), [a, b], np.zeros_like(a), np.matmul, 128


def factor(n, batch):
    @wp.kernel(module="unique")
    def kernel(a: wp.array3d(dtype=float), b: wp.array2d(dtype=float), x: wp.array2d(dtype=float)):
        i = wp.tid()
        f = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)))
        wp.tile_store(x[i], wp.tile_cholesky_solve(f, wp.tile_load(b[i], shape=n)))

    def reference(a, b):
        lower = np.tril(a) + np.tril(a, -1).transpose(0, 2, 1)
        return np.linalg.solve(lower, b[..., None])[..., 0]

    g = rng.normal(size=(batch, n, n))
    a = (g @ g.transpose(0, 2, 1) / n + np.eye(n)).astype(np.float32)
    b = rng.normal(size=(batch, n)).astype(np.float32)
    return kernel, batch, [a, b], np.zeros_like(b), reference, 32


CASES = {
    "scale": lambda gpu: scale(1 << (26 if gpu else 22), 1024),
    "softmax": lambda gpu: softmax(1 << (16 if gpu else 10), 1024),
    "product": lambda gpu: product(4096 if gpu else 512, 64),
    "product32": lambda gpu: product(4096 if gpu else 512, 32),
    "factor16": lambda gpu: factor(16, 65536 if gpu else 512),
    "factor32": lambda gpu: factor(32, 65536 if gpu else 512),
    "factor64": lambda gpu: factor(64, 16384 if gpu else 512),
}


def steady(run, seconds, prepare=lambda: None):
    """Least and median time of a call, in seconds, without what prepares each."""
    prepare()
    run()
    wp.synchronize()
    times, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 5:
        prepare()
        wp.synchronize()
        begin = time.perf_counter()
        run()
        wp.synchronize()
        times.append(time.perf_counter() - begin)
    return min(times), float(np.median(times))


def measure(case, device, seconds):
    kernel, dim, inputs, output, reference, threads = case
    given = [wp.array(one, dtype=float, device=device, requires_grad=True) for one in inputs]
    out = wp.array(output, dtype=float, device=device, requires_grad=True)
    grid = dim if isinstance(dim, tuple) else (dim,)

    def launch(**options):
        wp.launch_tiled(
            kernel,
            dim=grid,
            inputs=given,
            outputs=[out],
            block_dim=threads,
            device=device,
            **options,
        )

    def backward():
        launch(adj_inputs=[one.grad for one in given], adj_outputs=[out.grad], adjoint=True)

    forward = steady(launch, seconds)
    expected = reference(*(one.astype(np.float64) for one in inputs))
    error = np.abs(out.numpy() - expected).max() / np.abs(expected).max()
    return forward, steady(backward, seconds, lambda: out.grad.fill_(1.0)), error


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--only", default="")
    parser.add_argument("--seconds", type=float, default=0.5)
    options = parser.parse_args()
    wp.config.quiet = True
    wp.init()
    print("case       forward us  backward us  ratio  median ratio  error")
    for name, make in CASES.items():
        if options.only and name not in options.only.split(","):
            continue
        case = make(options.device != "cpu")
        forward, backward, error = measure(case, options.device, options.seconds)
        ratios = [b / f for f, b in zip(forward, backward, strict=True)]
        print(
            f"{name:10} {forward[0] * 1e6:10.0f} {backward[0] * 1e6:12.0f} {ratios[0]:6.2f} "
            f"{ratios[1]:13.2f}  {error:.1e}",
            flush=True,
        )


if __name__ == "__main__":
    main()
