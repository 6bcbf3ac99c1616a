"""Structs, tuples, components and slices in kernels."""

from typing import Any

import numpy as np

import warp as wp
from frontend_programs import run


@wp.struct
class Particle:
    position: wp.vec3
    mass: float
    id: int


@wp.struct
class Cloud:
    points: wp.array(dtype=wp.vec3)
    weights: wp.array2d(dtype=float)
    scale: float


def test_structs_are_values():
    @wp.func
    def moved(p: Particle, by: float):
        p.position.x += by
        return p

    @wp.kernel
    def kernel(p: Particle, out: wp.array(dtype=float)):
        q = moved(p, 10.0)
        out[0] = p.position.x
        out[1] = q.position.x
        fresh = Particle(mass=4.0)
        fresh.id = 2
        out[2] = fresh.mass * float(fresh.id) + fresh.position.z

    p = Particle(position=wp.vec3(1.0, 0.0, 0.0))
    assert run(kernel, p)[:3] == [1.0, 11.0, 8.0]


def test_arrays_in_structs():
    @wp.kernel
    def kernel(cloud: Cloud, out: wp.array(dtype=float)):
        i = wp.tid()
        row = cloud.weights[i]
        out[i] = cloud.points[i].y * cloud.scale + row[1]
        cloud.weights[i, 0] = float(cloud.weights.shape[1])
        cloud.points[i].x += 5.0

    cloud = Cloud(scale=2.0)
    cloud.points = wp.array(np.ones((3, 3), np.float32), dtype=wp.vec3, device="cpu")
    cloud.weights = wp.array(np.full((3, 2), 7.0, np.float32), device="cpu")
    assert run(kernel, cloud, n=3)[:3] == [9.0, 9.0, 9.0]
    assert cloud.weights.numpy()[:, 0].tolist() == [2.0, 2.0, 2.0]
    assert cloud.points.numpy()[:, 0].tolist() == [6.0, 6.0, 6.0]


def test_tuples():
    @wp.func
    def total(pair: Any, third: float):
        a, b = pair
        return a + b + third

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        a, b = 1.0, 2.0
        a, b = b, a
        t = (a, b, 4.0)
        out[0] = t[0]
        out[1] = t[-1]
        out[2] = total((a, b), 3.0)
        out[3] = float(len(t))
        v = wp.vec3(*t)
        out[4] = v.z
        x, y, z = v
        out[5] = x + y + z

    assert run(kernel)[:6] == [2.0, 4.0, 6.0, 3.0, 4.0, 7.0]


def test_vector_slices_and_matrix_columns():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        v = wp.vec4(1.0, 2.0, 3.0, 4.0)
        w = v[1:3]
        v[2:] = wp.vec2(8.0, 9.0)
        v[:2] = 5.0
        out[0] = w[0] + w[1]
        out[1] = v[0] + v[1] + v[2] + v[3]
        m = wp.mat22(1.0, 2.0, 3.0, 4.0)
        c = m[:, 1]
        m[:, 0] = wp.vec2(7.0, 6.0)
        out[2] = c[0] + c[1]
        out[3] = m[0][0] * 10.0 + m[1, 0]
        m[0, 1] += 0.5
        out[4] = m[0, 1]
        for i in range(4):
            v[i] *= 2.0
        out[5] = v[-1]

    assert run(kernel)[:6] == [5.0, 27.0, 6.0, 76.0, 2.5, 18.0]


def test_array_views_and_slices():
    @wp.kernel
    def kernel(x: wp.array2d(dtype=float), out: wp.array(dtype=float)):
        row = x[1]
        row[0] += 1.0
        part = row[1:3]
        part[0] = 50.0
        x[2][1] += 3.0
        out[0] = float(part.shape[0] + len(x))
        out[1] = x[-1, -1]

    x = wp.array(np.zeros((3, 4), np.float32), device="cpu")
    assert run(kernel, x)[:2] == [5.0, 0.0]
    assert x.numpy()[1].tolist() == [1.0, 50.0, 0.0, 0.0]
    assert x.numpy()[2].tolist() == [0.0, 3.0, 0.0, 0.0]


def test_shapes_are_tuples():
    @wp.kernel
    def kernel(x: wp.array2d(dtype=float), out: wp.array(dtype=int)):
        rows, columns = x.shape
        shape = x.shape
        out[0] = rows * 10 + columns
        out[1] = shape[1] + len(shape) + x.shape[-1]
        for axis in range(x.ndim):
            out[2] += x.shape[axis]

    x = wp.zeros((3, 4), dtype=float, device="cpu")
    assert run(kernel, x, dtype=int)[:3] == [34, 10, 7]
