"""Builtins written in the kernel language: Euler angles and spatial vectors."""

import numpy as np
import pytest

import warp as wp

ANGLES = (0.3, -0.7, 1.1)
A = np.array([0.5, -1.0, 2.0, 3.0, 0.25, -0.75])
B = np.array([1.5, 0.75, -0.5, 2.0, -3.0, 1.0])


def turn(axis, angle):
    """The matrix of a rotation about a coordinate axis."""
    c, s = np.cos(angle), np.sin(angle)
    m = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    m[a, a], m[b, b], m[a, b], m[b, a] = c, c, -s, s
    return m


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2), (0, 2, 1), (2, 0, 2)])
def test_quat_from_euler(device, order):
    @wp.kernel
    def kernel(e: wp.vec3, i: int, j: int, k: int, out: wp.array(dtype=wp.mat33)):
        out[0] = wp.quat_to_matrix(wp.quat_from_euler(e, i, j, k))

    i, j, k = order
    out = wp.zeros(1, dtype=wp.mat33, device=device)
    wp.launch(kernel, 1, [wp.vec3(*ANGLES), i, j, k, out], device=device)
    expected = turn(k, ANGLES[k]) @ turn(j, ANGLES[j]) @ turn(i, ANGLES[i])
    np.testing.assert_allclose(out.numpy()[0], expected, atol=1e-6)
    found = wp.quat_to_matrix(wp.quat_from_euler(wp.vec3(*ANGLES), i, j, k))
    np.testing.assert_allclose(np.array(found).reshape(3, 3), expected, atol=1e-6)


def expected_products():
    w, v, p, q = A[:3], A[3:], B[:3], B[3:]
    motion = np.concatenate([np.cross(w, p), np.cross(v, p) + np.cross(w, q)])
    force = np.concatenate([np.cross(w, p) + np.cross(v, q), np.cross(w, q)])
    return motion, force


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_spatial_vectors(device, dtype):
    spatial = wp.types.vector(6, dtype)

    @wp.kernel
    def kernel(a: spatial, b: spatial, out: wp.array2d(dtype=dtype)):
        motion = wp.spatial_cross(a, b)
        force = wp.spatial_cross_dual(a, b)
        top = wp.spatial_top(a)
        bottom = wp.spatial_bottom(a)
        for i in range(6):
            out[0, i] = motion[i]
            out[1, i] = force[i]
        for i in range(3):
            out[2, i] = top[i]
            out[2, i + 3] = bottom[i]
        out[3, 0] = wp.spatial_dot(a, b)

    out = wp.zeros((4, 6), dtype=dtype, device=device)
    wp.launch(kernel, 1, [spatial(*A), spatial(*B), out], device=device)
    motion, force = expected_products()
    expected = np.stack([motion, force, A, np.array([A @ B, 0, 0, 0, 0, 0])])
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-6)
    np.testing.assert_allclose(
        np.array(wp.spatial_cross(spatial(*A), spatial(*B))), motion, rtol=1e-6
    )
