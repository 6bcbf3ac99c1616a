"""Costs of code that a scene leaves out.

    python benchmarks/empty_loops.py [--device cuda:0] [--sizes 256,4096,65536] [--rounds 30]

Bodies fall, and a loop over contacts finds none: by a count among the arguments, in an array, or of
each body; a flag is false. Shown is the time of a launch, forward and backward, over that of a
kernel with the same parameters that reads as much and has no such code, the fastest of several
rounds over all kernels; the goal is 1.05. On a GPU launches are those of a graph; on a CPU they are
recorded ones, and time is that of the processors.
"""

import argparse
import linecache
import time

import numpy as np

import warp as wp

STEPS = 20

PARAMETERS = {
    **dict.fromkeys(("x", "v", "x1", "v1", "points", "normals", "forces"), wp.array[wp.vec3]),
    **dict.fromkeys(("counts", "chosen"), wp.array[int]),
    "count": int,
    "on": bool,
    "dt": float,
}

# The code between two lines of each kernel, by kind.
KINDS = {
    "nothing": "",
    "count alone": """
    a[0] += float(counts[i])""",
    "range alone": """
    a[0] += float(counts[i + 1] - counts[i])""",
    "flag": """
    if on:
        a += contact(x[i], v[i], points[0], normals[0])""",
    "count": """
    for k in range(count):
        a += contact(x[i], v[i], points[k], normals[k])""",
    "reaction": """
    for k in range(count):
        force = contact(x[i], v[i], points[k], normals[k])
        wp.atomic_sub(forces, k, force)
        a += force""",
    "element": """
    for k in range(counts[0]):
        a += contact(x[i], v[i], points[k], normals[k])""",
    "own count": """
    for k in range(counts[i]):
        j = chosen[k]
        a += contact(x[i], v[i], points[j], normals[j])""",
    "own range": """
    for k in range(counts[i], counts[i + 1]):
        j = chosen[k]
        a += contact(x[i], v[i], points[j], normals[j])""",
}

# The kernel that a kind is compared with, if not "nothing".
ALONE = {"own count": "count alone", "own range": "range alone"}


@wp.func
def contact(x: wp.vec3, v: wp.vec3, point: wp.vec3, normal: wp.vec3):
    depth = wp.dot(x - point, normal)
    force = wp.vec3(0.0)
    if depth < 0.0:
        speed = wp.dot(v, normal)
        slip = v - normal * speed
        force = -normal * (depth * 1.0e3 + speed * 10.0)
        force -= wp.normalize(slip) * wp.min(0.5 * wp.length(force), wp.length(slip))
    return force


def kernel_of(kind):
    """The kernel of a kind."""
    name = "move_" + kind.replace(" ", "_")
    text = f"""def {name}({", ".join(PARAMETERS)}):
    i = wp.tid()
    a = wp.vec3(0.0, -9.81, 0.0) - v[i] * 0.1{KINDS[kind]}
    w = v[i] + a * dt
    v1[i] = w
    x1[i] = x[i] + w * dt
"""
    file = f"<{name}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    space = {"wp": wp, "contact": contact}
    exec(compile(text, file, "exec"), space)
    space[name].__annotations__ = PARAMETERS
    return wp.kernel(space[name], module="unique")


def arguments_of(size, device):
    """Arguments for so many bodies, in the order of `PARAMETERS`."""
    random = np.random.default_rng(0)

    def vectors(count):
        data = random.random((count, 3)).astype(np.float32)
        return wp.array(data, dtype=wp.vec3, device=device, requires_grad=True)

    counts = wp.zeros(size + 1, dtype=int, device=device)
    chosen = wp.zeros(64, dtype=int, device=device)
    return [*(vectors(size) for _ in range(4)), *(vectors(64) for _ in range(3))] + [
        counts,
        chosen,
        0,
        False,
        1e-4,
    ]


def launch_of(kernel, size, values, device, backward):
    """A function that makes one launch, or its adjoint."""
    options = {}
    if backward:
        grads = [value.grad if isinstance(value, wp.array) else None for value in values]
        options = {"adj_inputs": grads, "adjoint": True}
    if wp.get_device(device).is_cpu:
        return wp.launch(kernel, size, values, device=device, record_cmd=True, **options).launch
    for _ in range(3):
        wp.launch(kernel, size, values, device=device, **options)
    with wp.ScopedCapture(device=device) as capture:
        wp.launch(kernel, size, values, device=device, **options)
    return lambda: wp.capture_launch(capture.graph)


def seconds(step, device):
    """The time of one step, the device included."""
    clock = time.process_time if wp.get_device(device).is_cpu else time.perf_counter
    wp.synchronize_device(device)
    begin = clock()
    for _ in range(STEPS):
        step()
    wp.synchronize_device(device)
    return (clock() - begin) / STEPS


def measure(size, device, rounds, kernels):
    """Seconds of a launch by kind, forward and backward."""
    values = arguments_of(size, device)
    steps = {
        (kind, backward): launch_of(kernel, size, values, device, backward)
        for kind, kernel in kernels.items()
        for backward in (False, True)
    }
    # Better code comes after a while.
    for step in steps.values():
        for _ in range(20):
            seconds(step, device)
    times = {name: [] for name in steps}
    for _ in range(rounds):
        for name, step in steps.items():
            times[name].append(seconds(step, device))
    return {name: min(found) for name, found in times.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--sizes", default="256,4096,65536")
    parser.add_argument("--rounds", type=int, default=30)
    options = parser.parse_args()
    wp.config.quiet = True
    kernels = {kind: kernel_of(kind) for kind in KINDS}
    columns = f"{'forward us':>12}{'ratio':>7}{'backward us':>13}{'ratio':>7}"
    print(f"{'bodies':>8} {'left out':11}{columns}")
    for size in map(int, options.sizes.split(",")):
        found = measure(size, options.device, options.rounds, kernels)
        for kind in KINDS:
            row = f"{size:8} {kind:11}"
            for backward, width in ((False, 12), (True, 13)):
                taken = found[kind, backward]
                without = found[ALONE.get(kind, "nothing"), backward]
                row += f"{taken * 1e6:{width}.2f}{taken / without:7.2f}"
            print(row)


if __name__ == "__main__":
    main()
