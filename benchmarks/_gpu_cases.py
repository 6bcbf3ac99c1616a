"""Single measurements of gpu.py, each in a process of its own.

    python _gpu_cases.py <measurement> --device cuda:0 [--seconds 1.0]

prints one line of JSON. The measurements are the functions whose name starts with `measure_`;
the kernels that spine.py measures too come from _spine_cases.py.
"""

import argparse
import ctypes
import json
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import _spine_cases as spine
import warp as wp

ITEMS = 1 << 26
EDGE = 512
SIDE = 8192
BYTES = 1 << 28
SAMPLES = 1 << 22


@wp.kernel(module="unique")
def stencil(u: wp.array3d(dtype=float), out: wp.array3d(dtype=float), c: float):
    i, j, k = wp.tid()
    inside = i > 0 and j > 0 and k > 0
    if inside and i < u.shape[0] - 1 and j < u.shape[1] - 1 and k < u.shape[2] - 1:
        around = u[i - 1, j, k] + u[i + 1, j, k] + u[i, j - 1, k] + u[i, j + 1, k]
        around += u[i, j, k - 1] + u[i, j, k + 1]
        out[i, j, k] = u[i, j, k] + c * (around - 6.0 * u[i, j, k])


@wp.kernel(module="unique")
def transpose(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    y[i, j] = x[j, i]


@wp.kernel(module="unique")
def total(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(out, 0, x[i])


@wp.kernel(module="unique")
def scatter(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(y, i, x[i])


@wp.kernel(module="unique")
def histogram(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(y, i & 1023, x[i])


@wp.kernel(module="unique")
def functions(x: wp.array(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    a = x[i]
    y[0, i] = wp.sin(a)
    y[1, i] = wp.exp(a)
    y[2, i] = wp.log(wp.abs(a))
    y[3, i] = wp.sin(a) * wp.exp(-a * a) + wp.sqrt(wp.abs(a)) + wp.log(1.0 + a * a)


def fastest(function, device, seconds, batch=10):
    """Seconds per call in the fastest batch, by events on the device's stream."""
    begin, end = (wp.Event(device, enable_timing=True) for _ in range(2))
    function()
    wp.synchronize_device(device)
    best, passes, stop = float("inf"), 0, time.perf_counter() + seconds
    while passes < 5 or (time.perf_counter() < stop and passes < 500):
        wp.record_event(begin)
        for _ in range(batch):
            function()
        wp.record_event(end)
        wp.synchronize_device(device)
        best = min(best, 1e-3 * wp.get_event_elapsed_time(begin, end) / batch)
        passes += 1
    return best


def measure_streams(device, seconds):
    """Bytes per second of kernels that do little but read and write, and of a plain copy."""

    def rate(count, function):
        return count / fastest(function, device, seconds)

    def launch(kernel, dim, inputs):
        return lambda: wp.launch(kernel, dim, inputs, device=device)

    result = {}
    x, y = spine.arrays(device, ITEMS, float, float)
    result["copy"] = rate(8 * ITEMS, lambda: wp.copy(y, x))
    result["saxpy"] = rate(12 * ITEMS, launch(spine.define_saxpy(), ITEMS, [0.5, x, y]))
    grid = wp.zeros((SIDE, SIDE), dtype=float, device=device)
    matrix = x.reshape((SIDE, SIDE))
    turned = matrix.transpose()
    result["transposed copy"] = rate(8 * ITEMS, lambda: wp.copy(grid, turned))
    wrong = float(np.abs(grid.numpy() - matrix.numpy().T).max())
    result["transposing kernel"] = rate(8 * ITEMS, launch(transpose, grid.shape, [matrix, grid]))
    result["copy again"] = rate(8 * ITEMS, lambda: wp.copy(y, x))
    cells = EDGE**3
    u = wp.zeros((EDGE, EDGE, EDGE), dtype=float, device=device)
    v = wp.zeros_like(u)
    result["stencil"] = rate(8 * cells, launch(stencil, u.shape, [u, v, 0.1]))
    n = ITEMS // 4
    x, v, f, w = spine.arrays(device, n, wp.vec3, wp.vec3, wp.vec3, float)
    inputs = [x, v, f, w, wp.vec3(0.0, -9.8, 0.0), 1e-3]
    result["integrate"] = rate(64 * n, launch(spine.define_integrate(), n, inputs))
    result["copy"] = max(result["copy"], result.pop("copy again"))
    return result | {"wrong": wrong}


def units(value, exact):
    """Largest error in units of the last place of float32."""
    spacing = np.spacing(np.abs(exact).astype(np.float32)).astype(np.float64)
    return float((np.abs(value - exact) / spacing).max())


def measure_math(device, seconds):
    """sin·exp items per second, and errors of its parts and of the whole."""
    rng = np.random.default_rng(7)
    data = rng.standard_normal(SAMPLES, dtype=np.float32)
    x = wp.array(data, dtype=float, device=device)
    y = wp.zeros((4, data.size), dtype=float, device=device)
    wp.launch(functions, data.size, [x, y], device=device)
    a, values = data.astype(np.float64), y.numpy().astype(np.float64)
    whole = np.sin(a) * np.exp(-a * a) + np.sqrt(np.abs(a)) + np.log(1.0 + a * a)
    result = {
        "sin": units(values[0], np.sin(a)),
        "exp": units(values[1], np.exp(a)),
        "log": units(values[2], np.log(np.abs(a))),
        "whole": units(values[3], whole),
    }
    x = wp.array(rng.standard_normal(ITEMS, dtype=np.float32), dtype=float, device=device)
    y = wp.zeros_like(x)
    kernel = spine.define_math()
    result["rate"] = ITEMS / fastest(
        lambda: wp.launch(kernel, ITEMS, [x, y], device=device), device, seconds
    )
    n = 16384
    points, force = spine.arrays(device, n, wp.vec3, wp.vec3)
    kernel = spine.define_nbody()
    result["nbody"] = (
        n
        * n
        / fastest(
            lambda: wp.launch(kernel, n, [points, force, n, 1e-4], device=device),
            device,
            seconds,
            2,
        )
    )
    return result


def measure_atomics(device, seconds):
    """Atomic additions per second by how many addresses they share, and the error of a sum."""
    (x,) = spine.arrays(device, ITEMS, float)
    result = {}
    for name, kernel, size in (
        ("one", total, 1),
        ("1024", histogram, 1024),
        ("distinct", scatter, ITEMS),
    ):
        y = wp.zeros(size, dtype=float, device=device)
        wp.launch(kernel, ITEMS, [x, y], device=device)
        if name == "one":
            exact = float(x.numpy().sum(dtype=np.float64))
            result["error"] = abs(float(y.numpy()[0]) - exact) / exact
        result[name] = ITEMS / fastest(
            lambda k=kernel, y=y: wp.launch(k, ITEMS, [x, y], device=device), device, seconds, 4
        )
    return result


class Driver:
    """Plain copies between page-locked host memory and the device, through the CUDA driver."""

    def __init__(self, device):
        self.library = ctypes.CDLL("libcuda.so.1")
        wp.zeros(1, device=device)  # the primary context is current
        context = ctypes.c_void_p()
        ordinal = int(device.partition(":")[2] or 0)
        self.call("cuInit", 0)
        self.call("cuDevicePrimaryCtxRetain", ctypes.byref(context), ordinal)
        self.call("cuCtxSetCurrent", context)
        self.host, self.device = ctypes.c_void_p(), ctypes.c_uint64()
        self.call("cuMemHostAlloc", ctypes.byref(self.host), ctypes.c_size_t(BYTES), 0)
        self.call("cuMemAlloc_v2", ctypes.byref(self.device), ctypes.c_size_t(BYTES))
        ctypes.memset(self.host, 1, BYTES)

    def call(self, name, *arguments):
        result = getattr(self.library, name)(*arguments)
        if result:
            raise RuntimeError(f"{name} returns {result}")

    def upload(self):
        size = ctypes.c_size_t(BYTES)
        self.call("cuMemcpyHtoDAsync_v2", self.device, self.host, size, None)

    def download(self):
        size = ctypes.c_size_t(BYTES)
        self.call("cuMemcpyDtoHAsync_v2", self.host, self.device, size, None)


def rates(functions, synchronize, seconds):
    """Bytes per second of each, in the fastest of alternating passes."""
    best = dict.fromkeys(functions, float("inf"))
    for function in functions.values():
        function()
    synchronize()
    stop, passes = time.perf_counter() + seconds, 0
    while passes < 5 or (time.perf_counter() < stop and passes < 200):
        for name, function in functions.items():
            begin = time.perf_counter()
            function()
            synchronize()
            best[name] = min(best[name], time.perf_counter() - begin)
        passes += 1
    return {name: BYTES / time for name, time in best.items()}


def measure_transfers(device, seconds):
    """Bytes per second between host and device: ours, the driver's and PyTorch's."""
    count = BYTES // 4
    card = wp.zeros(count, dtype=float, device=device)
    pinned = wp.zeros(count, dtype=float, device="cpu", pinned=True)
    pageable = wp.zeros(count, dtype=float, device="cpu")
    driver = Driver(device)

    def synchronize():
        wp.synchronize_device(device)
        driver.call("cuCtxSynchronize")

    result = rates(
        {
            "pinned up": lambda: wp.copy(card, pinned),
            "driver up": driver.upload,
            "pinned down": lambda: wp.copy(pinned, card),
            "driver down": driver.download,
        },
        synchronize,
        2 * seconds,
    )
    pairs = {
        "pageable up": lambda: wp.copy(card, pageable),
        "pageable down": lambda: wp.copy(pageable, card),
    }
    try:
        import torch
    except ImportError:
        return result | rates(pairs, synchronize, seconds)
    there = torch.zeros(count, device=device)
    here = torch.zeros(count)
    pairs["torch up"] = lambda: there.copy_(here)
    pairs["torch down"] = lambda: here.copy_(there)

    def synchronize_both():
        torch.cuda.synchronize()
        synchronize()

    return result | rates(pairs, synchronize_both, 2 * seconds)


def instructions(text):
    """Instructions of PTX text: lines that end a statement and are no directive."""
    lines = (line.strip() for line in text.splitlines())
    return sum(1 for line in lines if line.endswith(";") and not line.startswith("."))


def assemble(ptx, folder):
    """Registers, bytes of spills and of stack that ptxas reports for PTX text."""
    architecture = re.search(r"^\.target (\w+)", ptx, re.MULTILINE)[1]
    source = Path(folder) / "kernel.ptx"
    source.write_text(ptx, encoding="utf-8")
    done = subprocess.run(
        ["ptxas", "-v", f"-arch={architecture}", str(source), "-o", str(source) + ".cubin"],
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"ptxas fails: {done.stderr[-500:]}")
    return reports(done.stderr)[""]


def reports(text):
    """Resource usage in what ptxas prints, by entry; the last one under "", too."""
    found, entry = {}, ""
    for line in text.splitlines():
        if match := re.search(r"entry function '(\w+)'", line):
            entry = match[1]
        if match := re.search(r"(\d+) bytes stack frame, (\d+) bytes spill stores", line):
            found[entry] = {"stack": int(match[1]), "spills": int(match[2])}
        if match := re.search(r"Used (\d+) registers", line):
            found.setdefault(entry, {})["registers"] = int(match[1])
            found[""] = found[entry]
    return found


def measure_registers(device, seconds):
    """Registers and PTX instructions of our kernels and of nvcc's for the same source."""
    architecture = f"sm_{wp.get_device(device).arch}" if "cuda" in device else "sm_90"
    kernels = {
        name: (define(), len(dim) if isinstance(dim, tuple) else 1)
        for name, (define, dim, _) in spine.compile_arguments("cpu").items()
    }
    kernels |= {"stencil": (stencil, 3), "scatter": (scatter, 1)}
    compiler = shutil.which("nvcc")
    result = {}
    with tempfile.TemporaryDirectory() as folder:
        theirs, counts = {}, {}
        if compiler:
            command = [compiler, "-O3", f"-arch={architecture}", "--keep", "--keep-dir", folder]
            command += ["-cubin", "-Xptxas", "-v", "-o", f"{folder}/twins.cubin"]
            source = Path(__file__).with_name("twins.cu")
            done = subprocess.run([*command, str(source)], capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"nvcc fails: {done.stderr[-500:]}")
            theirs = reports(done.stderr)
            text = Path(folder, "twins.ptx").read_text(encoding="utf-8")
            for part in text.split(".entry ")[1:]:
                counts[re.match(r"\w+", part)[0]] = instructions(part)
        for name, (kernel, rank) in kernels.items():
            ptx = kernel.ir("ptx", device if "cuda" in device else None, rank)
            entry = kernel.func.__name__
            ours = {"instructions": instructions(ptx)}
            if shutil.which("ptxas"):
                ours |= assemble(ptx, folder)
            row = {"ours": ours}
            if entry in theirs:
                row["nvcc"] = theirs[entry] | {"instructions": counts[entry]}
            result[name] = row
    return result


def main():
    """Run one measurement."""
    parser = argparse.ArgumentParser()
    parser.add_argument("measurement")
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--seconds", type=float, default=1.0)
    options = parser.parse_args()
    wp.config.quiet = True
    result = globals()["measure_" + options.measurement](options.device, options.seconds)
    sys.stdout.write("\n" + json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
