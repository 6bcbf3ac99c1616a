"""Norms, twists and matrices of transforms against formulas in float64."""

import math

import numpy as np
import pytest

import warp as wp


def rotation(axis, angle):
    """Rodrigues' formula."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def matrix(value):
    return np.array([[value[i, j] for j in range(4)] for i in range(4)], dtype=np.float64)


@pytest.mark.parametrize("components", [(3.0, -4.0), (1e25, -1e25, 1e25), (1e-25, 0.0, 0.0, 2e-25)])
def test_norms(components):
    v = wp.types.vector(len(components), wp.float32)(*components)
    exact = np.array(components, dtype=np.float64)
    assert wp.norm_l1(v) == pytest.approx(np.abs(exact).sum(), rel=1e-6)
    assert wp.norm_l2(v) == pytest.approx(np.linalg.norm(exact), rel=1e-6)


@pytest.mark.parametrize("length", [0.0, 0.5, 1.0, 2.0, 1e20])
@pytest.mark.parametrize("delta", [0.25, 1.0, 3.0])
def test_huber(length, delta):
    v = wp.vec3d(0.0, length, 0.0)
    loss = 0.5 * length**2 if length <= delta else delta * (length - 0.5 * delta)
    assert float(wp.norm_huber(v, wp.float64(delta))) == pytest.approx(loss, rel=1e-14)
    smooth = delta * math.sqrt(1 + (length / delta) ** 2)
    assert float(wp.norm_pseudo_huber(v, wp.float64(delta))) == pytest.approx(smooth, rel=1e-14)
    assert float(wp.smooth_normalize(v, wp.float64(delta))[1]) == pytest.approx(
        length / smooth, rel=1e-14
    )


def test_default_of_delta():
    v = wp.vec2(3.0, 4.0)
    assert wp.norm_huber(v) == wp.norm_huber(v, 1.0) == pytest.approx(4.5)


@pytest.mark.parametrize("roll", [-3.0, 0.0, 1.0])
@pytest.mark.parametrize("pitch", [-1.57, -1.0, 0.0, 1e-6, 1.5])
@pytest.mark.parametrize("yaw", [-2.0, 0.25])
def test_rpy_and_back(roll, pitch, yaw):
    q = wp.quat_rpy(wp.float64(roll), wp.float64(pitch), wp.float64(yaw))
    assert list(map(float, wp.quat_to_rpy(q))) == pytest.approx([roll, pitch, yaw], abs=1e-12)


def test_rpy_keeps_digits_near_a_right_angle():
    angle = math.pi / 2 - 1e-9
    q = wp.quat_rpy(wp.float64(0.0), wp.float64(angle), wp.float64(0.0))
    assert float(wp.quat_to_rpy(q)[1]) == pytest.approx(angle, abs=1e-15)


@pytest.mark.parametrize("angle", [-2.5, -0.1, 0.0, 0.7, 3.0])
def test_twist(angle):
    axis = wp.vec3d(0.0, 0.0, 1.0)
    swing = wp.quat_from_axis_angle(wp.vec3d(1.0, 0.0, 0.0), wp.float64(0.4))
    twist = wp.quat_from_axis_angle(axis, wp.float64(angle))
    q = wp.mul(swing, twist)
    assert list(map(float, wp.quat_twist(axis, q))) == pytest.approx(
        list(map(float, twist)), abs=1e-14
    )
    assert float(wp.quat_twist_angle_signed(axis, q)) == pytest.approx(angle, abs=1e-14)
    assert float(wp.quat_twist_angle(axis, q)) == pytest.approx(abs(angle), abs=1e-14)


def test_matrix_of_transform():
    axis, angle = (1.0, 2.0, -0.5), 2.0
    unit = np.array(axis) / np.linalg.norm(axis)
    q = wp.quat_from_axis_angle(wp.vec3d(*unit), wp.float64(angle))
    m = wp.transform_to_matrix(wp.transformd(wp.vec3d(1.0, -2.0, 3.0), q))
    expected = np.eye(4)
    expected[:3, :3] = rotation(axis, angle)
    expected[:3, 3] = 1.0, -2.0, 3.0
    np.testing.assert_allclose(matrix(m), expected, atol=1e-15)
    back = wp.transform_from_matrix(m)
    assert list(map(float, back)) == pytest.approx([1.0, -2.0, 3.0, *map(float, q)], abs=1e-15)


def test_compose_and_decompose():
    q = wp.quat_from_axis_angle(wp.vec3d(0.0, 1.0, 0.0), wp.float64(0.3))
    m = wp.transform_compose(wp.vec3d(1.0, 2.0, 3.0), q, wp.vec3d(2.0, 0.5, 7.0))
    expected = np.eye(4)
    expected[:3, :3] = rotation((0, 1, 0), 0.3) * np.array([2.0, 0.5, 7.0])
    expected[:3, 3] = 1.0, 2.0, 3.0
    np.testing.assert_allclose(matrix(m), expected, atol=1e-15)
    position, turn, scale = wp.transform_decompose(m)
    assert list(position) == [1.0, 2.0, 3.0]
    assert list(map(float, turn)) == pytest.approx(list(map(float, q)), abs=1e-15)
    assert list(map(float, scale)) == pytest.approx([2.0, 0.5, 7.0], rel=1e-15)


def test_decompose_of_singular_matrix_is_finite():
    m = wp.transform_compose(
        wp.vec3(0.0, 0.0, 0.0), wp.quat(0.0, 0.0, 0.0, 1.0), wp.vec3(1.0, 0.0, 1.0)
    )
    _, turn, scale = wp.transform_decompose(m)
    assert np.isfinite(list(turn)).all()
    assert list(map(float, scale)) == [1.0, 0.0, 1.0]


@wp.kernel
def angles_of_constants(out: wp.array(dtype=float)):
    out[0] = wp.atan2(0.0, 0.0)
    out[1] = wp.atan2(-0.0, -0.0)
    # Here the coordinates become constants after the quaternions are taken apart.
    q = wp.quat_from_euler(wp.vec3(0.6, wp.HALF_PI, 0.2), 2, 1, 0)
    e = wp.quat_to_euler(q, 2, 1, 0)
    r = wp.quat_from_euler(e, 2, 1, 0)
    out[2] = wp.abs(q[0] * r[0] + q[1] * r[1] + q[2] * r[2] + q[3] * r[3])


def test_angles_of_constants(device):
    out = wp.zeros(3, device=device)
    wp.launch(angles_of_constants, 1, [out], device=device)
    assert np.allclose(out.numpy(), [0, -np.pi, 1], atol=1e-6)
