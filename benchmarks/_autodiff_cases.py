"""Kernels and single measurements of autodiff.py; runs under this package and NVIDIA Warp.

    python _autodiff_cases.py <measurement> --device cpu [--seconds 1.0]

prints one line of JSON. The measurements are the functions whose name starts with `measure_`.
"""

import math
import resource
import time

import numpy as np

import _spine_cases as spine
import warp as wp
from _spine_cases import alone, steady


def define_stencil():
    @alone
    def stencil(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float), n: int):
        i, j = wp.tid()
        if i > 0 and j > 0 and i < n - 1 and j < n - 1:
            around = x[i - 1, j] + x[i + 1, j] + x[i, j - 1] + x[i, j + 1]
            y[i, j] = x[i, j] + 0.2 * (around - 4.0 * x[i, j])

    return stencil


def define_neo_hookean():
    @alone
    def neo_hookean(F: wp.array(dtype=wp.mat33), e: wp.array(dtype=float), mu: float, lam: float):
        i = wp.tid()
        f = F[i]
        J = wp.determinant(f)
        I1 = wp.trace(wp.transpose(f) * f)
        lj = wp.log(J)
        e[i] = 0.5 * mu * (I1 - 3.0) - mu * lj + 0.5 * lam * lj * lj

    return neo_hookean


def define_sines(real):
    @alone
    def sines(x: wp.array(dtype=real), n: int, y: wp.array(dtype=real)):
        i = wp.tid()
        s = x[i]
        for _ in range(n):
            s = wp.sin(s)
        y[i] = s

    return sines


def define_mean():
    @alone
    def mean(x: wp.array(dtype=float), n: int, y: wp.array(dtype=float)):
        i = wp.tid()
        state = wp.rand_init(1, i)
        s = float(0.0)
        for _ in range(n):
            s += wp.sin(x[i] * wp.randf(state))
        y[i] = s / float(n)

    return mean


def define_growth():
    @alone
    def growth(x: wp.array(dtype=float), n: int, y: wp.array(dtype=float)):
        i = wp.tid()
        state = wp.rand_init(1, i)
        s = x[i]
        for _ in range(n):
            s = s * (0.995 + 0.01 * wp.randf(state))
        y[i] = s

    return growth


def define_relaxation(real):
    @alone
    def relaxation(k: wp.array(dtype=real), n: int, dt: real, y: wp.array(dtype=real)):
        i = wp.tid()
        s = real(0.0)
        for j in range(n):
            t = dt * real(j + 1)
            s = (s + dt * k[i] * wp.cos(t)) / (real(1.0) + dt * k[i])
        y[i] = s

    return relaxation


def define_energy(real):
    matrix = wp.types.matrix((3, 3), real)

    @alone
    def energy(F: wp.array(dtype=matrix), e: wp.array(dtype=real)):
        i = wp.tid()
        f = F[i]
        lj = wp.log(wp.determinant(f))
        e[i] = real(0.5) * wp.trace(wp.transpose(f) * f) - lj + real(2.5) * lj * lj

    return energy


class Arrays:
    """Random arrays with gradients on a device."""

    def __init__(self, device):
        self.device, self.rng = device, np.random.default_rng(1)

    def random(self, dtype, n, offset=0.0):
        shape = {wp.vec3: (n, 3), wp.mat33: (n, 3, 3)}.get(dtype, (n,))
        data = self.rng.random(shape, dtype=np.float32) + np.float32(offset)
        return self.array(data, dtype)

    def array(self, data, dtype, grad=True):
        return wp.array(data, dtype=dtype, device=self.device, requires_grad=grad)

    def zeros(self, dtype, shape):
        return wp.zeros(shape, dtype=dtype, device=self.device, requires_grad=True)


def grid_springs(side):
    """Positions and pairs of a square grid of springs."""
    ids = np.arange(side * side).reshape(side, side)
    across = np.stack([ids[:, :-1].ravel(), ids[:, 1:].ravel()], 1)
    down = np.stack([ids[:-1].ravel(), ids[1:].ravel()], 1)
    places = np.stack([*np.meshgrid(np.arange(side), np.arange(side)), np.zeros((side, side))], -1)
    pairs = np.concatenate([across, down]).astype(np.int32)
    return 1.01 * places.reshape(-1, 3).astype(np.float32), pairs


def problems(device, small=False):
    """Per kernel: its definition, launch dimension and arguments."""
    make = Arrays(device)
    gpu = "cuda" in device
    n = 64 if small else 1 << (25 if gpu else 22)
    bodies = 64 if small else (16384 if gpu else 2048)
    side = 8 if small else (2048 if gpu else 256)
    cells = 16 if small else (4096 if gpu else 1024)
    eighth = n // 8
    eye = 2.0 * np.eye(3, dtype=np.float32)
    near = np.eye(3, dtype=np.float32) + 0.1 * make.rng.random((eighth, 3, 3), dtype=np.float32)
    places, pairs = grid_springs(side)
    gravity = wp.vec3(0.0, -9.8, 0.0)
    vectors = [make.random(wp.vec3, n // 2) for _ in range(3)]
    weights = make.array(make.rng.random(n // 2, dtype=np.float32), float, False)
    springs = [
        make.array(places, wp.vec3),
        make.zeros(wp.vec3, len(places)),
        make.array(pairs.ravel(), int, False),
        make.array(np.ones(len(pairs), np.float32), float),
        make.zeros(wp.vec3, len(places)),
        1000.0,
        1.0,
    ]
    matrices = make.rng.random((eighth, 3, 3), dtype=np.float32) + eye
    return {
        "saxpy": (spine.define_saxpy, n, [2.0, make.random(float, n), make.random(float, n)]),
        "integrate": (spine.define_integrate, n // 2, [*vectors, weights, gravity, 1e-3]),
        "springs": (spine.define_springs, len(pairs), springs),
        "n-body": (
            spine.define_nbody,
            bodies,
            [make.random(wp.vec3, bodies), make.zeros(wp.vec3, bodies), bodies, 1e-4],
        ),
        "stencil": (
            define_stencil,
            (cells, cells),
            [
                make.array(make.rng.random((cells, cells), dtype=np.float32), float),
                make.zeros(float, (cells, cells)),
                cells,
            ],
        ),
        "mat33 inverse": (
            spine.define_mat33,
            eighth,
            [
                make.array(matrices, wp.mat33),
                make.random(wp.vec3, eighth),
                make.zeros(wp.vec3, eighth),
            ],
        ),
        "neo-Hookean": (
            define_neo_hookean,
            eighth,
            [make.array(near, wp.mat33), make.zeros(float, eighth), 1.0, 10.0],
        ),
    }


def passes(kernel, dim, inputs, device):
    """Functions that launch the kernel and its adjoint."""
    adjoints = [item.grad if getattr(item, "requires_grad", False) else None for item in inputs]
    adjoints = [
        None if isinstance(item, wp.array) and grad is None else (item if grad is None else grad)
        for item, grad in zip(inputs, adjoints)
    ]

    def forward():
        wp.launch(kernel, dim, inputs, device=device)

    def backward():
        wp.launch(
            kernel, dim, inputs, adj_inputs=adjoints, adj_outputs=[], adjoint=True, device=device
        )

    return forward, backward


def counts(kernel):
    """The code of a kernel's adjoint; empty under NVIDIA Warp."""
    if not hasattr(getattr(wp, "autograd", None), "adjoint_metrics"):
        return {}
    return dict(wp.autograd.adjoint_metrics(kernel))


def measure_ratios(device, seconds):
    """Seconds of forward and backward launches, and counts of the adjoint.

    Launches of a GPU are queued, as those of a program are.
    """
    result = {}
    batch = 10 if "cuda" in device else 1
    for name, (define, dim, inputs) in problems(device).items():
        kernel = define()
        try:
            forward, backward = passes(kernel, dim, inputs, device)
            before = steady(forward, device, seconds / 2, batch)
            after = steady(backward, device, seconds, batch)
            before = min(before, steady(forward, device, seconds / 2, batch))
            result[name] = {"forward": before, "backward": after, "counts": counts(kernel)}
        except Exception as problem:
            result[name] = {"error": f"{type(problem).__name__}: {problem}"[:300]}
    return result


def measure_directions(device, seconds):
    """Seconds of launches with tangents along 1, 4 and 8 directions, and of those without."""
    from warp._src.arrays.observers import Observing
    from warp._src.autograd.tangents import WIDTHS, Tangents

    result = {}
    for name, (define, dim, inputs) in problems(device).items():
        if name not in ("saxpy", "n-body", "mat33 inverse", "neo-Hookean"):
            continue
        kernel = define()

        def forward(kernel=kernel, dim=dim, inputs=inputs):
            wp.launch(kernel, dim, inputs, device=device)

        result[name] = {"forward": steady(forward, device, seconds / 2)}
        for width in WIDTHS:
            state = Tangents(width=width)
            for one in inputs:
                if isinstance(one, wp.array):
                    state.twin(one)
            with Observing(executor=state):
                result[name][str(width)] = steady(forward, device, seconds / 2)
    return result


def measure_compile(device, seconds):
    """Milliseconds of the first forward and the first adjoint launch of each kernel."""
    data = spine.arrays(device, 1, *[float] * 4)
    wp.launch(spine.define_four_arrays(), 1, data, device=device)
    wp.synchronize_device(device)
    result = {}
    for name, (define, dim, inputs) in problems(device, small=True).items():
        times = []
        try:
            begin = time.perf_counter()
            kernel = define()
            for run in passes(kernel, dim, inputs, device):
                run()
                wp.synchronize_device(device)
                times.append(1e3 * (time.perf_counter() - begin))
                begin = time.perf_counter()
            result[name] = {"forward": times[0], "adjoint": times[1]}
        except Exception as problem:
            result[name] = {"error": f"{type(problem).__name__}: {problem}"[:300]}
    return result


def reference(x, n):
    """Π cos x_k of x = sin(x), n times, in float64."""
    product = 1.0
    for _ in range(n):
        product *= math.cos(x)
        x = math.sin(x)
    return product


def tapes():
    """How long loops have their values again: ways that there are here, the default first."""
    return ("checkpoints", "global") if hasattr(wp.config, "tape") else ("",)


def timed_loop(kernel, threads, rest, device, real=wp.float32):
    """A forward and a backward launch of a kernel of an array, `rest` and a result, best of 3."""
    make = Arrays(device)
    x, y = make.array(np.ones(threads), real), make.zeros(real, threads)
    forward, backward = passes(kernel, threads, [x, *rest, y], device)
    forward()
    passes(kernel, threads, [x, *[1] * len(rest), y], device)[1]()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    times = {}
    for run in (forward, backward) * 3:
        x.grad.zero_()
        y.grad.fill_(1.0)
        wp.synchronize_device(device)
        begin = time.perf_counter()
        run()
        wp.synchronize_device(device)
        times[run] = min(times.get(run, math.inf), time.perf_counter() - begin)
    return {
        "forward": times[forward],
        "backward": times[backward],
        "kilobytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak,
        "gradient": float(x.grad.numpy()[0]),
        "counts": counts(kernel),
    }


def measure_iterations(device, seconds):
    """A loop of a million iterations, backwards: seconds, memory and error; and many shorter."""
    n = 10**6
    result = {"reference": reference(1.0, n), "long": {}, "many": {}, "samples": {}}
    for tape in tapes():
        if tape:
            wp.config.tape = tape
        label = ", global tape" if tape == "global" else ""
        for real in (wp.float32, wp.float64):
            found = timed_loop(define_sines(real), 1, [n], device, real)
            result["long"][real.__name__ + label] = found
        found = timed_loop(define_sines(wp.float32), 10**4, [10**3], device)
        result["many"]["10^4 threads of 10^3 iterations" + label] = found
    result["samples"]["10^3 sums of 10^4 samples"] = timed_loop(
        define_mean(), 10**3, [10**4], device
    )
    result["samples"]["10^3 products of 10^4 samples"] = timed_loop(
        define_growth(), 10**3, [10**4], device
    )
    return result


def stiff_reference(k, n, dt):
    """Derivative by k of the relaxation after n implicit steps, in extended precision."""
    k, dt = np.asarray(k, np.longdouble), np.longdouble(dt)
    s, ds = np.zeros_like(k), np.zeros_like(k)
    for j in range(n):
        c = np.cos(dt * np.longdouble(j + 1))
        below = 1 + dt * k
        new = (s + dt * k * c) / below
        ds = (ds + dt * c - dt * new) / below
        s = new
    return ds


def extreme_reference(f):
    """Gradient of the energy of `define_energy` in extended precision."""
    f = f.astype(np.longdouble)
    a, b, c = f[:, 0], f[:, 1], f[:, 2]
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], 1)
    volume = (a * cofactors[:, 0]).sum(1)[:, None, None]
    return f + (5 * np.log(volume) - 1) * cofactors / volume


def timed_gradient(kernel, dim, inputs, output, device, seconds):
    """Seconds of a backward launch, and the gradient of the first input for unit seeds."""
    forward, backward = passes(kernel, dim, inputs, device)
    forward()

    def both():
        inputs[0].grad.zero_()
        output.grad.fill_(1.0)
        backward()

    both()
    gradient = inputs[0].grad.numpy().astype(np.longdouble)
    return steady(both, device, seconds), gradient


def measure_precision(device, seconds):
    """Error and seconds of gradients: a stiff relaxation, and extreme deformations."""
    make, stiff, extreme = Arrays(device), {}, {}
    k = np.float32(np.geomspace(1.0, 1e6, 256)).astype(np.float64)
    for steps in (10, 100, 1000):
        dt = 2.0 ** -round(math.log2(steps))
        wanted = stiff_reference(k, steps, dt)
        for real in (wp.float32, wp.float64):
            arrays = [make.array(k, real), steps, dt, make.zeros(real, len(k))]
            kernel = define_relaxation(real)
            spent, got = timed_gradient(kernel, len(k), arrays, arrays[3], device, seconds / 4)
            error = float(np.abs((got - wanted) / wanted).max())
            stiff[f"{real.__name__}, {steps} steps"] = {"seconds": spent, "error": error}
    rng, n = np.random.default_rng(3), 4096
    turns = [np.linalg.qr(rng.normal(size=(n, 3, 3)))[0] for _ in range(2)]
    turns = [q * np.sign(np.linalg.det(q))[:, None, None] for q in turns]
    for span in (1, 2, 3):
        stretch = 10.0 ** rng.uniform(-span / 2, span / 2, (n, 3))
        f = np.float32(turns[0] * stretch[:, None, :] @ turns[1].transpose(0, 2, 1))
        f = f[np.linalg.det(f.astype(np.float64)) > 0]
        wanted = extreme_reference(f)
        size = np.abs(wanted).max(axis=(1, 2), keepdims=True)
        for real in (wp.float32, wp.float64):
            matrix = wp.types.matrix((3, 3), real)
            arrays = [make.array(f, matrix), make.zeros(real, len(f))]
            kernel = define_energy(real)
            spent, got = timed_gradient(kernel, len(f), arrays, arrays[1], device, seconds / 4)
            error = float(np.median((np.abs(got - wanted) / size).max(axis=(1, 2))))
            worst = float((np.abs(got - wanted) / size).max())
            label = f"{real.__name__}, stretches 1e±{span / 2:g}"
            extreme[label] = {"seconds": spent, "error": error, "worst": worst}
    return {"stiff": stiff, "extreme": extreme}


if __name__ == "__main__":
    spine.main(globals())
