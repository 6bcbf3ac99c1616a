"""Save a kernel and a graph for saxpy.c.

python examples/c/saxpy_kernels.py [FOLDER]
"""

import sys
from pathlib import Path

import warp as wp


@wp.kernel
def saxpy(x: wp.array[float], y: wp.array[float], a: float):
    i = wp.tid()
    y[i] = a * x[i] + y[i]


@wp.kernel
def double(x: wp.array[float]):
    i = wp.tid()
    x[i] = 2.0 * x[i]


def save(folder, device="cpu"):
    """The files of the module and of the graph."""
    folder = Path(folder)
    (module,) = wp.compile_aot_module(
        sys.modules[__name__], device=device, module_dir=folder, strip_hash=True
    )
    x = wp.zeros(1000, dtype=float, device=device)
    with wp.ScopedCapture(device=device, apic=True) as capture:
        wp.launch(double, 1000, [x], device=device)
    graph = folder / "double.wrp"
    wp.capture_save(capture.graph, str(graph), inputs={"x": x})
    return Path(module), graph


if __name__ == "__main__":
    for path in save(sys.argv[1] if len(sys.argv) > 1 else "."):
        print(path)
