"""Saves the kernel that integrate.cpp launches: `python integrate_kernels.py [folder [sm]]`."""

import sys

import warp as wp


@wp.kernel
def integrate(x: wp.array[wp.vec3], v: wp.array[wp.vec3], gravity: wp.vec3, dt: float):
    i = wp.tid()
    v[i] = v[i] + gravity * dt
    x[i] = x[i] + v[i] * dt


def save(folder=".", arch=None):
    """Compiles for the CPU, or for a GPU architecture that need not be there."""
    device = "cpu" if arch is None else None
    module = sys.modules[__name__]
    return wp.compile_aot_module(
        module, device=device, arch=arch, module_dir=folder, strip_hash=True
    )


if __name__ == "__main__":
    chosen = int(sys.argv[2]) if len(sys.argv) > 2 else None
    target = sys.argv[1] if len(sys.argv) > 1 else "."
    for path in save(target, chosen):
        print(path)
