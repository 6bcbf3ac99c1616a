"""Mass-spring chain: structs, functions, constants, several kernels, a timer."""

from __future__ import annotations

import argparse

import numpy as np

import warp as wp

GRAVITY = wp.constant(wp.vec3(0.0, -9.81, 0.0))
STIFFNESS = 500.0


@wp.struct
class Material:
    stiffness: float
    damping: float
    rest: wp.array[float]


@wp.func
def spring(a: wp.vec3, b: wp.vec3, rest: float, stiffness: float) -> wp.vec3:
    d = b - a
    length = wp.length(d)
    return wp.normalize(d) * ((length - rest) * stiffness)


@wp.kernel
def forces(x: wp.array[wp.vec3], v: wp.array[wp.vec3], m: Material, f: wp.array[wp.vec3]):
    i = wp.tid()
    pull = spring(x[i], x[i + 1], m.rest[i], m.stiffness)
    drag = (v[i + 1] - v[i]) * m.damping
    wp.atomic_add(f, i, pull + drag)
    wp.atomic_sub(f, i + 1, pull + drag)


@wp.kernel(enable_backward=False)
def integrate(x: wp.array[wp.vec3], v: wp.array[wp.vec3], f: wp.array[wp.vec3], dt: float):
    i = wp.tid()
    if i > 0:
        v[i] = v[i] + (f[i] + GRAVITY) * dt
        x[i] += v[i] * dt
    f[i] = wp.vec3()


def simulate(count: int, steps: int, device: str | None = None) -> np.ndarray:
    start = np.zeros((count, 3), dtype=np.float32)
    start[:, 0] = np.linspace(0.0, 1.0, count)
    x = wp.array(start, dtype=wp.vec3, device=device)
    v = wp.zeros_like(x)
    f = wp.zeros(count, dtype=wp.vec3, device=device)
    material = Material()
    material.stiffness = STIFFNESS
    material.damping = 0.1
    material.rest = wp.full(count - 1, 1.0 / (count - 1), dtype=float, device=device)
    with wp.ScopedTimer("steps", print=False) as timer:
        for _ in range(steps):
            wp.launch(forces, dim=count - 1, inputs=[x, v, material], outputs=[f], device=device)
            wp.launch(integrate, dim=count, inputs=[x, v, f, 1e-3], device=device)
    wp.synchronize()
    print(f"{timer.elapsed:.2f} ms")
    return x.numpy()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=20)
    options = parser.parse_args()
    end = simulate(options.count, 100, "cpu")
    assert end.shape == (options.count, 3)
    print(end[-1])
