"""Kernels and single measurements of spine.py; runs under this package and under NVIDIA Warp.

    python _spine_cases.py <measurement> --device cpu [--seconds 1.0]

prints one line of JSON. The measurements are the functions whose name starts with `measure_`.
"""

import time

START = time.perf_counter()

import argparse  # noqa: E402
import json  # noqa: E402
import statistics  # noqa: E402
import sys  # noqa: E402

import warp as wp  # noqa: E402

IMPORTED = time.perf_counter()
# In NVIDIA Warp "unique" gives each kernel a module, that is a compilation, of its own.
alone = wp.kernel(module="unique")


def define_saxpy():
    @alone
    def saxpy(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = a * x[i] + y[i]

    return saxpy


def define_integrate():
    @alone
    def integrate(
        x: wp.array(dtype=wp.vec3),
        v: wp.array(dtype=wp.vec3),
        f: wp.array(dtype=wp.vec3),
        w: wp.array(dtype=float),
        gravity: wp.vec3,
        dt: float,
    ):
        tid = wp.tid()
        x0 = x[tid]
        v0 = v[tid]
        v1 = v0 + (f[tid] * w[tid] + gravity) * dt
        x[tid] = x0 + v1 * dt
        v[tid] = v1

    return integrate


def define_math():
    @alone
    def sin_exp(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        a = x[i]
        y[i] = wp.sin(a) * wp.exp(-a * a) + wp.sqrt(wp.abs(a)) + wp.log(1.0 + a * a)

    return sin_exp


def define_nbody():
    @alone
    def nbody(x: wp.array(dtype=wp.vec3), a: wp.array(dtype=wp.vec3), n: int, eps: float):
        i = wp.tid()
        xi = x[i]
        acc = wp.vec3(0.0, 0.0, 0.0)
        for j in range(n):
            r = x[j] - xi
            d2 = wp.dot(r, r) + eps
            inv = 1.0 / wp.sqrt(d2)
            acc += r * (inv * inv * inv)
        a[i] = acc

    return nbody


def define_springs():
    @alone
    def springs(
        x: wp.array(dtype=wp.vec3),
        v: wp.array(dtype=wp.vec3),
        idx: wp.array(dtype=int),
        rest: wp.array(dtype=float),
        f: wp.array(dtype=wp.vec3),
        ke: float,
        kd: float,
    ):
        t = wp.tid()
        i = idx[t * 2 + 0]
        j = idx[t * 2 + 1]
        xij = x[i] - x[j]
        vij = v[i] - v[j]
        length = wp.length(xij)
        d = xij / length
        c = length - rest[t]
        fs = d * (ke * c + kd * wp.dot(d, vij))
        wp.atomic_sub(f, i, fs)
        wp.atomic_add(f, j, fs)

    return springs


def define_sums(deterministic):
    """A sum into one element and sums into scattered ones, both of vectors or floats."""
    option = {"deterministic": deterministic}

    @wp.kernel(module="unique", module_options=option)
    def total(x: wp.array(dtype=float), s: wp.array(dtype=float)):
        wp.atomic_add(s, 0, x[wp.tid()])

    @wp.kernel(module="unique", module_options=option)
    def pulls(x: wp.array(dtype=wp.vec3), ends: wp.array2d(dtype=int), f: wp.array(dtype=wp.vec3)):
        t = wp.tid()
        i, j = ends[t, 0], ends[t, 1]
        d = x[j] - x[i]
        force = d * (1.0 - 1.0 / (wp.length(d) + 0.1))
        wp.atomic_add(f, i, force)
        wp.atomic_sub(f, j, force)

    return total, pulls


def define_mandelbrot():
    @alone
    def mandelbrot(out: wp.array2d(dtype=float), w: int, h: int, iters: int):
        i, j = wp.tid()
        cx = float(j) / float(w) * 3.0 - 2.0
        cy = float(i) / float(h) * 2.0 - 1.0
        zx = float(0.0)
        zy = float(0.0)
        k = int(0)
        while k < iters and zx * zx + zy * zy < 4.0:
            t = zx * zx - zy * zy + cx
            zy = 2.0 * zx * zy + cy
            zx = t
            k = k + 1
        out[i, j] = float(k)

    return mandelbrot


def define_mat33():
    @alone
    def mat33(a: wp.array(dtype=wp.mat33), b: wp.array(dtype=wp.vec3), y: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        m = a[i]
        y[i] = wp.inverse(m) * b[i] + wp.transpose(m) * b[i] * wp.determinant(m)

    return mat33


def define_four_arrays():
    @alone
    def four(
        a: wp.array(dtype=float),
        b: wp.array(dtype=float),
        c: wp.array(dtype=float),
        d: wp.array(dtype=float),
    ):
        i = wp.tid()
        d[i] = a[i] + b[i] + c[i]

    return four


def arrays(device, n, *types, seed=1):
    """Random arrays of `n` items."""
    import numpy as np  # not above: `measure_first` shows what a program without it waits for

    rng = np.random.default_rng(seed)
    made = []
    for dtype in types:
        shape = {wp.vec3: (n, 3), wp.mat33: (n, 3, 3)}.get(dtype, (n,))
        data = np.zeros(n, np.int32) if dtype is int else rng.random(shape, dtype=np.float32)
        made.append(wp.array(data, dtype=dtype, device=device))
    return made


def compile_arguments(device):
    """Per kernel: its definition, the launch dimension and arguments for a first launch."""
    x, v, f, y3, scalar, other, index, matrix = arrays(
        device, 2, *[wp.vec3] * 4, float, float, int, wp.mat33
    )
    grid = wp.zeros((2, 2), dtype=float, device=device)
    gravity = wp.vec3(0.0, -9.8, 0.0)
    return {
        "saxpy": (define_saxpy, 1, [2.0, scalar, other]),
        "integrate": (define_integrate, 1, [x, v, f, scalar, gravity, 1e-3]),
        "sin·exp": (define_math, 1, [scalar, other]),
        "n-body": (define_nbody, 1, [x, y3, 2, 1e-4]),
        "springs": (define_springs, 1, [x, v, index, scalar, f, 1.0, 1.0]),
        "mandelbrot": (define_mandelbrot, (1, 1), [grid, 2, 2, 9]),
        "mat33": (define_mat33, 1, [matrix, x, y3]),
    }


def measure_compile(device, seconds):
    """Milliseconds from Python function to finished first launch, per kernel, and by phase.

    The process is warm: another kernel has been compiled before. The caller chooses an
    empty or a full disk cache.
    """
    four = arrays(device, 1, *[float] * 4)
    wp.launch(define_four_arrays(), 1, four, device=device)
    wp.synchronize_device(device)
    result = {}
    for name, (define, dim, inputs) in compile_arguments(device).items():
        begin = time.perf_counter()
        kernel = define()
        wp.launch(kernel, dim, inputs, device=device)
        wp.synchronize_device(device)
        total = 1e3 * (time.perf_counter() - begin)
        phases = getattr(getattr(kernel, "native", None), "compile_times", dict)()
        result[name] = {"total": total, "phases": phases}
    return result


def steady(function, device, seconds, batch=1):
    """Seconds per call in the fastest batch; batches are closed by a synchronisation.

    The fastest, because other work on the machine can only make a batch slower.
    """
    function()
    wp.synchronize_device(device)
    times = []
    end = time.perf_counter() + seconds
    while len(times) < 7 or (time.perf_counter() < end and len(times) < 500):
        begin = time.perf_counter()
        for _ in range(batch):
            function()
        wp.synchronize_device(device)
        times.append((time.perf_counter() - begin) / batch)
    return min(times)


def throughput(device, seconds, scale):
    """Bytes per second of saxpy and integrate; `scale` is the number of saxpy items."""
    batch = 10 if "cuda" in device else 1
    x, y = arrays(device, scale, float, float)
    kernel = define_saxpy()
    saxpy = steady(
        lambda: wp.launch(kernel, scale, [0.5, x, y], device=device), device, seconds, batch
    )
    n = scale // 4
    x, v, f, w = arrays(device, n, wp.vec3, wp.vec3, wp.vec3, float)
    inputs = [x, v, f, w, wp.vec3(0.0, -9.8, 0.0), 1e-3]
    kernel = define_integrate()
    step = steady(lambda: wp.launch(kernel, n, inputs, device=device), device, seconds, batch)
    a = wp.zeros(scale * 3 // 2, dtype=float, device=device)
    b = wp.zeros_like(a)
    copy = steady(lambda: wp.copy(b, a), device, seconds, batch)
    return {
        "saxpy": 12 * scale / saxpy,
        "saxpy_bytes": 12 * scale,
        "integrate": 64 * n / step,
        "integrate_bytes": 64 * n,
        "copy": 8 * a.shape[0] / copy,
    }


def measure_streams(device, seconds):
    """Throughput of arrays far larger than caches."""
    return throughput(device, seconds, 1 << (26 if "cuda" in device else 24))


def measure_cached_streams(device, seconds):
    """Throughput at the sizes of the peer comparison."""
    return throughput(device, seconds, 1 << 22)


def measure_arithmetic(device, seconds):
    """n-body pairs per second and sin·exp items per second."""
    n = 16384 if "cuda" in device else 2048
    x, a = arrays(device, n, wp.vec3, wp.vec3)
    nbody = define_nbody()
    pairs = steady(lambda: wp.launch(nbody, n, [x, a, n, 1e-4], device=device), device, seconds)
    m = 1 << (26 if "cuda" in device else 22)
    x, y = arrays(device, m, float, float)
    math = define_math()
    items = steady(lambda: wp.launch(math, m, [x, y], device=device), device, seconds)
    return {"nbody": n * n / pairs, "math": m / items}


def measure_sums(device, seconds):
    """Seconds of sums by atomics and of exact ones: 16 M floats, 4 springs for each of n points."""
    import numpy as np

    scale = 1 << 24
    x, s = arrays(device, scale, float)[0], wp.zeros(1, dtype=float, device=device)
    n = 1 << (20 if "cuda" in device else 18)
    points, f = arrays(device, n, wp.vec3, wp.vec3)
    near = np.random.default_rng(2).integers(1, 50, 4 * n)
    first = np.arange(4 * n) // 4
    ends = wp.array(np.stack([first, (first + near) % n], 1), dtype=int, device=device)
    result = {}
    for name in ("not_guaranteed", "run_to_run", "gpu_to_gpu"):
        total, pulls = define_sums(name)
        result[f"total_{name}"] = -steady(
            lambda k=total: wp.launch(k, scale, [x, s], device=device), device, seconds
        )
        result[f"springs_{name}"] = -steady(
            lambda k=pulls: wp.launch(k, 4 * n, [points, ends, f], device=device), device, seconds
        )
    return result


def measure_launch(device, seconds):
    """Seconds per launch of a kernel with four array arguments, host side."""
    four = arrays(device, 1, *[float] * 4)
    kernel = define_four_arrays()
    launch = wp.launch
    launch(kernel, 1, four, device=device)
    wp.synchronize_device(device)
    times = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        for _ in range(100):
            launch(kernel, 1, four, device=device)
        times.append((time.perf_counter() - begin) / 100)
        wp.synchronize_device(device)
    return {"median": statistics.median(times), "best": min(times)}


def measure_first(device, seconds):
    """Seconds from before `import warp` to after the first launch."""
    x, y = (wp.zeros(1, dtype=float, device=device) for _ in range(2))
    wp.launch(define_saxpy(), 1, [2.0, x, y], device=device)
    wp.synchronize_device(device)
    return {"import": IMPORTED - START, "total": time.perf_counter() - START}


def main(measurements=None):
    """Run one of the measurements, those of this file by default."""
    parser = argparse.ArgumentParser()
    parser.add_argument("measurement")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--seconds", type=float, default=1.0)
    options = parser.parse_args()
    wp.config.quiet = True
    if options.measurement != "first":
        wp.init()
    measurements = measurements or globals()
    result = measurements["measure_" + options.measurement](options.device, options.seconds)
    result["version"] = getattr(wp, "__version__", wp.config.version)
    sys.stdout.write("\n" + json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
