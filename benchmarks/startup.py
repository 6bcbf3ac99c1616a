"""Start-up time of a program until its first launch has run, part by part.

    python benchmarks/startup.py [--device cuda:0] [--repeats 7]

Each part is a program in processes of its own; shown is what it takes beyond the part that it
stands on. The driver's share is what a program without this package pays, too: a context and
memory. It is part of the line `array`. Times on the clock and of the processors are the best of the
repeats; the latter hardly depend on what else the machine does.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time

GOAL = 200.0
PARTS = {
    "interpreter": "pass",
    "NumPy": "import numpy",
    "package": "import warp",
    "array": "import warp as wp; wp.zeros(4, dtype=float, device={device!r})",
}
DRIVER = """
import ctypes
cuda = ctypes.CDLL("libcuda.so.1")
context, memory = ctypes.c_void_p(), ctypes.c_uint64()
assert cuda.cuInit(0) == 0
assert cuda.cuDevicePrimaryCtxRetain(ctypes.byref(context), {number}) == 0
assert cuda.cuCtxSetCurrent(context) == 0
assert cuda.cuMemAlloc_v2(ctypes.byref(memory), ctypes.c_size_t(4096)) == 0
"""
PROGRAM = """
import warp as wp

@wp.kernel
def scale(x: wp.array(dtype=float), a: float):
    i = wp.tid()
    x[i] = a * x[i]

wp.launch(scale, 4, [wp.zeros(4, dtype=float, device={device!r}), 2.0], device={device!r})
wp.synchronize_device({device!r})
"""
PARTS["first cached launch"] = PROGRAM
# The parts that each part requires.
BASES = {
    "NumPy": "interpreter",
    "driver": "interpreter",
    "package": "interpreter",
    "array": "package",
    "first cached launch": "array",
}


def processors():
    """Seconds of processors, in the process and the system, of all children so far."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measure(file, environment, repeats):
    """Milliseconds on the clock and of the processors, the best of some processes each."""
    clock, spent = [], []
    for _ in range(repeats):
        before, begin = processors(), time.perf_counter()
        subprocess.run([sys.executable, file], env=environment, check=True)
        clock.append(1e3 * (time.perf_counter() - begin))
        spent.append(1e3 * (processors() - before))
    return min(clock), min(spent)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--repeats", type=int, default=7)
    options = parser.parse_args()
    parts = dict(PARTS)
    if options.device != "cpu":
        parts["driver"] = DRIVER.format(number=int(options.device.partition(":")[2] or 0))
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"WARP_CACHE_PATH": os.path.join(folder, "cache")}
        if environment.pop("PYTHONDONTWRITEBYTECODE", None):
            # As in an installed package, modules are compiled once; else imports take four times
            # as long.
            environment["PYTHONPYCACHEPREFIX"] = os.path.join(folder, "modules")
        for name, text in parts.items():
            place = os.path.join(folder, f"{name.replace(' ', '_')}.py")
            with open(place, "w") as file:
                file.write(text.format(device=options.device))
            # Fills the cache of kernels, and those of the system.
            subprocess.run([sys.executable, place], env=environment, check=True)
            found[name] = measure(place, environment, options.repeats)
    print(f"{'part':<22}{'ms':>8}{'CPU ms':>8}")
    for name, (clock, spent) in found.items():
        base = found.get(BASES.get(name), (0.0, 0.0))
        print(f"{name:<22}{clock - base[0]:>8.1f}{spent - base[1]:>8.1f}")
    clock, spent = found["first cached launch"]
    verdict = "met" if clock <= GOAL else "missed"
    print(f"{'in all':<22}{clock:>8.1f}{spent:>8.1f}  goal {GOAL:.0f} ms: {verdict}")
    if "driver" in found:
        shares = (found["driver"][i] - found["interpreter"][i] for i in range(2))
        clock, spent = (whole - share for whole, share in zip((clock, spent), shares, strict=True))
        print(f"{'without the driver':<22}{clock:>8.1f}{spent:>8.1f}")


if __name__ == "__main__":
    main()
