"""Euler angles and spatial vectors against NumPy in float64."""

import itertools

import numpy as np
import pytest

import warp as wp

ORDERS = list(itertools.permutations(range(3)))


def random_rotation(seed):
    q = np.random.default_rng(seed).normal(size=4)
    return q / np.linalg.norm(q)


def about(axis, angle):
    v = np.zeros(3)
    v[axis] = 1.0
    return wp.quat_from_axis_angle(wp.vec3d(*v), wp.float64(angle))


def euler(angles, order):
    """Rotation about the first axis, then the second, then the third, fixed in space."""
    i, j, k = order
    return wp.mul(about(k, angles[k]), wp.mul(about(j, angles[j]), about(i, angles[i])))


def same_rotation(p, q, tolerance):
    p, q = np.array(p, float), np.array(q, float)
    return min(np.abs(p - q).max(), np.abs(p + q).max()) <= tolerance


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles(order):
    i, j, k = order

    @wp.kernel
    def measure(q: wp.array(dtype=wp.quatd), e: wp.array(dtype=wp.vec3d)):
        t = wp.tid()
        e[t] = wp.quat_to_euler(q[t], i, j, k)

    middle = np.array([-1.2, 0.0, 1.0, 1.5707, np.pi / 2, -np.pi / 2])
    angles = np.zeros((len(middle), 3))
    angles[:, i], angles[:, j], angles[:, k] = 2.5, middle, -0.7
    q = [euler(one, order) for one in angles]
    e = wp.zeros(len(q), dtype=wp.vec3d)
    wp.launch(measure, dim=len(q), inputs=[wp.array(q, dtype=wp.quatd)], outputs=[e])
    found = e.numpy()
    for one, expected in zip(found, q):
        assert same_rotation(euler(one, order), expected, 1e-15)
    assert np.abs(found).max() <= np.pi and np.abs(found[:, j]).max() <= np.pi / 2 + 1e-15
    np.testing.assert_allclose(found[:3], angles[:3], atol=1e-14)
    np.testing.assert_allclose(found[3], angles[3], atol=1e-11)


@pytest.mark.parametrize("order", ORDERS)
def test_euler_angles_in_kernels(order):
    i, j, k = order
    q = wp.quat(*random_rotation(1))

    @wp.kernel
    def there_and_back(q: wp.quat, result: wp.array(dtype=wp.quat)):
        result[0] = wp.quat_from_euler(wp.quat_to_euler(q, i, j, k), i, j, k)

    result = wp.zeros(1, dtype=wp.quat)
    wp.launch(there_and_back, dim=1, inputs=[q, result])
    assert same_rotation(result.numpy()[0], q, 1e-6)


def test_carrying_motions_and_forces():
    spatial, square = wp.types.vector(6, wp.float32), wp.types.matrix((6, 6), wp.float32)

    @wp.kernel
    def carry(
        t: wp.transform,
        x: spatial,
        at: wp.vec3,
        carried: wp.array(dtype=spatial),
        matrix: wp.array(dtype=square),
        velocity: wp.array(dtype=wp.vec3),
    ):
        carried[0] = wp.transform_twist(t, x)
        carried[1] = wp.transform_wrench(t, x)
        r = wp.quat_to_matrix(wp.transform_get_rotation(t))
        matrix[0] = wp.spatial_adjoint(r, wp.skew(wp.transform_get_translation(t)) * r)
        velocity[0] = wp.velocity_at_point(x, at)

    q, p, at = random_rotation(2), np.array([1.0, 2.0, 3.0]), np.array([0.5, -1.0, 2.0])
    w, v = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    carried, matrix = wp.zeros(2, dtype=spatial), wp.zeros(1, dtype=square)
    velocity = wp.zeros(1, dtype=wp.vec3)
    inputs = [wp.transform(wp.vec3(*p), wp.quat(*q)), spatial(*w, *v), wp.vec3(*at)]
    wp.launch(carry, dim=1, inputs=inputs, outputs=[carried, matrix, velocity])

    r = np.array(wp.quat_to_matrix(wp.quatd(*q))).reshape(3, 3)
    twist = np.concatenate([r @ w, r @ v + np.cross(p, r @ w)])
    wrench = np.concatenate([r @ w + np.cross(p, r @ v), r @ v])
    np.testing.assert_allclose(carried.numpy(), [twist, wrench], rtol=1e-5)
    np.testing.assert_allclose(matrix.numpy()[0] @ np.concatenate([w, v]), twist, rtol=1e-5)
    np.testing.assert_allclose(velocity.numpy()[0], np.cross(w, at) + v, rtol=1e-6)
