"""Sorts, scans, sums, sparse products and solves: times, and ratios beside other libraries.

    libraries.py [--device cuda:0] [--size small|large] [--peer PYTHON] [--cub FILE] [--json FILE]

Beside NumPy and SciPy on the CPU, PyTorch and CuPy on a GPU, as far as they are installed (their
sparse products are cuSPARSE's). `--cub` names what cub.cu was compiled to: CUB is called then
with nothing in between. `--peer` names a Python that has warp-lang: the same script runs there
as well, and its times are put beside ours. A ratio above 1 says that ours is faster.
"""

import argparse
import functools
import json
import subprocess
import sys
import time

import numpy as np

import warp as wp
import warp.sparse
import warp.utils
from cub import Cub
from matrices import laplacian, random_matrix
from warp.optim import linear

SIZES = {"small": 1_000_000, "large": 30_000_000}
# Rows of a square grid whose Laplacian is the matrix.
GRIDS = {"small": 300, "large": 2000}


def best(run, finish, together=1, repeats=7) -> float:
    """Seconds of a run: the fastest of some times for `together` of them, after a first one."""
    times = []
    for _ in range(repeats + 1):
        finish()
        start = time.perf_counter()
        for _ in range(together):
            run()
        finish()
        times.append((time.perf_counter() - start) / together)
    return min(times[1:])


def optional(name):
    try:
        return __import__(name, fromlist=["_"])
    except ImportError:
        return None


class Bench:
    """The cases on one device."""

    def __init__(self, device, size, cub):
        self.device, self.count, self.side = wp.get_device(device), SIZES[size], GRIDS[size]
        self.rng = np.random.default_rng(1)
        self.torch = optional("torch") if self.device.is_cuda else None
        self.cupy = optional("cupyx.scipy.sparse") if self.device.is_cuda else None
        self.cub = Cub(cub) if cub else None
        self.finish = lambda: wp.synchronize_device(self.device)
        # Launches of a GPU wait in a queue, as in a program.
        self.together = 10 if self.device.is_cuda else 1
        self.results = {}

    def add(self, name, ours, others, amount, unit) -> None:
        """Times ours and others', given as functions; `amount` in units of 1e9."""
        seconds = best(ours, self.finish, self.together)
        row = {"seconds": seconds, "rate": amount / seconds / 1e9, "unit": unit}
        for library, (run, finish) in others.items():
            row[library] = best(run, finish, self.together) / seconds
        self.results[name] = row

    def torch_case(self, run):
        return {"torch": (run, self.torch.cuda.synchronize)} if self.torch else {}

    def cub_case(self, name, *arguments, before=None):
        """A function of cub.cu, after another one."""
        if not self.cub:
            return {}
        call = self.cub.case(name, *arguments)

        def run():
            if before:
                before()
            call()

        return {"cub": (run, self.finish)}

    def sorts(self) -> None:
        n = self.count
        for bits in (32, 64):
            keys = self.rng.integers(0, 2**63, n, dtype=np.uint64).astype(f"u{bits // 8}")
            dtype = wp.uint32 if bits == 32 else wp.uint64
            source = wp.array(keys, dtype=dtype, device=self.device)
            k = wp.empty(2 * n, dtype=dtype, device=self.device)
            v = wp.empty(2 * n, dtype=wp.int32, device=self.device)

            # Both sort in place, with room for as much again: both begin with a copy.
            def fill(k=k, source=source):
                wp.copy(k, source, count=n)

            def ours(k=k, v=v, fill=fill):
                fill()
                wp.utils.radix_sort_pairs(k, v, n)

            others = {}
            if self.device.is_cpu:
                others["numpy"] = (
                    lambda keys=keys: np.argsort(keys, kind="stable"),
                    lambda: None,
                )
            elif self.torch:
                signed = self.torch.from_numpy(keys.view(f"i{bits // 8}")).cuda()
                others = self.torch_case(lambda t=signed: self.torch.sort(t, stable=True))
            halves = k[:n], k[n:], v[:n], v[n:]
            others |= self.cub_case(f"sort_pairs_uint{bits}", *halves, n, before=fill)
            self.add(f"sort pairs, {bits}-bit keys", ours, others, n, "Gpair/s")

    def scans(self) -> None:
        n = self.count
        for dtype in (wp.int32, wp.float32, wp.float64):
            numbers = self.rng.integers(0, 9, n).astype(dtype.__name__)
            source = wp.array(numbers, dtype=dtype, device=self.device)
            result = wp.empty_like(source)
            others = {}
            if self.device.is_cpu:
                others["numpy"] = (
                    lambda a=numbers, out=numbers.copy(): np.cumsum(a, dtype=a.dtype, out=out),
                    lambda: None,
                )
            elif self.torch:
                t = self.torch.from_numpy(numbers).cuda()
                others = self.torch_case(
                    lambda t=t: self.torch.cumsum(t, 0, dtype=t.dtype, out=self.torch.empty_like(t))
                )
            others |= self.cub_case(f"scan_{dtype.__name__}", source, wp.empty_like(source), n)
            moved = 2 * n * numbers.itemsize
            self.add(
                f"scan {dtype.__name__}",
                lambda source=source, result=result: wp.utils.array_scan(source, result),
                others,
                moved,
                "GB/s",
            )

    def sums(self) -> None:
        n = self.count
        numbers = self.rng.random(n, dtype=np.float32)
        a = wp.array(numbers, dtype=wp.float32, device=self.device)
        out = wp.zeros(1, dtype=wp.float32, device=self.device)
        others = {}
        if self.device.is_cpu:
            others["numpy"] = (lambda: numbers.sum(dtype=np.float64), lambda: None)
        elif self.torch:
            t = self.torch.from_numpy(numbers).cuda()
            others = self.torch_case(lambda: self.torch.sum(t))
        others |= self.cub_case("sum_float32", a, wp.zeros_like(out), n)
        run = functools.partial(wp.utils.array_sum, a, out=out)
        self.add("sum of float32", run, others, 4 * n, "GB/s")
        inner = wp.zeros(1, dtype=wp.float32, device=self.device)
        others = {}
        if self.device.is_cpu:
            others["numpy"] = (lambda: np.dot(numbers, numbers), lambda: None)
        elif self.torch:
            others = self.torch_case(lambda: self.torch.dot(t, t))
        run = functools.partial(wp.utils.array_inner, a, a, out=inner)
        self.add("inner product of float32", run, others, 4 * n, "GB/s")

    def runs(self) -> None:
        """Runs of four equal numbers, and segments of a hundred pairs."""
        n = self.count
        numbers = np.sort(self.rng.integers(0, n // 4, n, dtype=np.int32))
        source = wp.array(numbers, dtype=int, device=self.device)
        values, lengths = wp.empty_like(source), wp.empty_like(source)
        total = wp.zeros(1, dtype=int, device=self.device)
        made = wp.empty_like(values), wp.empty_like(lengths), wp.zeros_like(total)
        others = self.cub_case("runs_int32", source, *made, n)
        run = functools.partial(wp.utils.runlength_encode, source, values, lengths, total)
        self.add("runs of int32", run, others, n, "Gnumber/s")

        keys = wp.array(self.rng.integers(-n, n, 2 * n, dtype=np.int32), device=self.device)
        values = wp.zeros_like(keys)
        starts = np.arange(0, n + 1, 100, dtype=np.int32)
        offsets = wp.array(starts, dtype=int, device=self.device)
        made = wp.clone(keys), wp.empty_like(keys), wp.clone(values), wp.empty_like(values)
        others = self.cub_case("sort_segments_int32", *made, n, starts.size - 1, offsets)
        run = functools.partial(wp.utils.segmented_sort_pairs, keys, values, n, offsets)
        self.add("sort of segments of 100", run, others, n, "Gpair/s")

    def other_products(self, matrix, x, block):
        scipy = optional("scipy.sparse") if self.device.is_cpu else None
        if scipy:
            arrays = (matrix.values.numpy(), matrix.columns.numpy(), matrix.offsets.numpy())
            count = matrix.nnz
            arrays = (arrays[0][:count], arrays[1][:count], arrays[2])
            kind = scipy.csr_matrix if block == 1 else scipy.bsr_matrix
            other = kind(arrays, shape=matrix.shape)
            v = x.numpy().ravel()
            return {"scipy": (lambda: other @ v, lambda: None)}
        arrays = (matrix.offsets, matrix.columns[: matrix.nnz], matrix.values[: matrix.nnz])
        others = {}
        if self.torch and block == 1:
            tensors = map(wp.to_torch, arrays)
            other = self.torch.sparse_csr_tensor(*tensors, size=matrix.shape)
            v = wp.to_torch(x)
            others = self.torch_case(lambda: other @ v)
        if self.cupy and block == 1:
            import cupy

            offsets, columns, values = (cupy.asarray(a) for a in arrays)
            same = self.cupy.csr_matrix((values, columns, offsets), shape=matrix.shape)
            w = cupy.asarray(x)
            others["cupy"] = (lambda: same @ w, cupy.cuda.Device().synchronize)
        return others

    def product(self, name, matrix, block) -> None:
        dtype = wp.float32 if block == 1 else wp.vec3
        x = wp.ones(matrix.ncol, dtype=dtype, device=self.device)
        y = wp.zeros_like(x)
        others = self.other_products(matrix, x, block)
        moved = matrix.nnz * (4 + 4 * block * block) + 12 * matrix.shape[0]
        run = functools.partial(wp.sparse.bsr_mv, matrix, x, y, beta=0.0)
        self.add(name, run, others, moved, "GB/s")

    def sparse(self) -> None:
        for block in (1, 3):
            name = f"product with a vector, blocks of {block}"
            self.product(name, laplacian(self.side, block, self.device), block)
        count = self.side * self.side // 16
        self.product(
            "product, 64 in each row", random_matrix(np.full(count, 64), self.rng, self.device), 1
        )
        # A few rows have a good part of all numbers, as hubs of graphs do.
        lengths = np.minimum(self.rng.pareto(1.2, count) * 8 + 1, count // 8).astype(int)
        self.product(
            "product, rows of a power law", random_matrix(lengths, self.rng, self.device), 1
        )

    def solves(self) -> None:
        matrix = laplacian(self.side, 1, self.device)
        b = wp.ones(matrix.nrow, dtype=wp.float32, device=self.device)
        x = wp.zeros_like(b)
        # 100 iterations without checks.
        solver = linear.cg(
            matrix, b, x, tol=0.0, atol=1e-30, maxiter=100, check_every=100, run=False
        )
        others = {}
        scipy = optional("scipy.sparse") if self.device.is_cpu else None
        if scipy:
            import scipy.sparse.linalg as linalg

            count = matrix.nnz
            arrays = [matrix.values.numpy()[:count], matrix.columns.numpy()[:count]]
            other = scipy.csr_matrix((*arrays, matrix.offsets.numpy()), shape=matrix.shape)
            right = b.numpy()
            others["scipy"] = (
                lambda: linalg.cg(other, right, rtol=0.0, atol=0.0, maxiter=100),
                lambda: None,
            )

        def ours():
            x.zero_()
            solver()

        self.add("100 iterations of CG", ours, others, 1e8, "kiteration/s")

    def run(self) -> dict:
        for case in (self.sorts, self.scans, self.sums, self.runs, self.sparse, self.solves):
            case()
        return self.results


def peer_results(python, arguments) -> dict:
    """The figures of this script there."""
    command = [python, __file__, "--device", arguments.device, "--size", arguments.size]
    done = subprocess.run([*command, "--json", "-"], capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--size", choices=SIZES, default="small")
    parser.add_argument("--peer")
    parser.add_argument("--cub")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    results = Bench(arguments.device, arguments.size, arguments.cub).run()
    if arguments.peer:
        for name, row in peer_results(arguments.peer, arguments).items():
            results[name]["peer"] = row["seconds"] / results[name]["seconds"]
    if arguments.json == "-":
        print(json.dumps(results))
        return
    for name, row in results.items():
        beside = [
            f"{row[other]:6.2f} x {other}"
            for other in ("numpy", "scipy", "torch", "cupy", "cub", "peer")
            if other in row
        ]
        print(f"{name:40} {row['rate']:8.3f} {row['unit']:12} {'  '.join(beside)}")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    sys.exit(main())
