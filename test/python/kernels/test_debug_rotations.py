"""Debugging launches name rotations by quaternions that are not of unit length."""

import numpy as np
import pytest

import warp as wp


@wp.kernel(module_options={"mode": "debug"}, module="unique")
def checked(q: wp.array(dtype=wp.quat), v: wp.vec3, y: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    y[i] = wp.quat_rotate(q[i], v) + wp.quat_rotate_inv(q[i], v)


@wp.kernel
def plain(q: wp.array(dtype=wp.quat), v: wp.vec3, y: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    y[i] = wp.quat_rotate(q[i], v)


def rotate(kernel, q, device):
    q = wp.array(np.array([q], np.float32), dtype=wp.quat, requires_grad=True, device=device)
    y = wp.zeros(1, dtype=wp.vec3, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(kernel, 1, [q, wp.vec3(1.0, 2.0, 3.0)], [y], device=device)
    wp.synchronize_device(device)
    tape.backward(grads={y: wp.ones_like(y)})
    return y.numpy()[0]


@pytest.mark.parametrize("q", [(0, 0, 0, 1.0001), (0.1, 0.2, 0.3, 0.4), (0, 0, 0, 0)])
def test_rotation_by_a_quaternion_of_another_length(device, q):
    with pytest.raises(wp.WarpError, match=r"length 1.*scales") as error:
        rotate(checked, q, device)
    assert "test_debug_rotations.py:" in str(error.value)


@pytest.mark.parametrize("q", [(0, 0, 0, 1), (0.5, -0.5, 0.5, 0.5), (0.6, 0, 0, 0.8)])
def test_unit_quaternions_are_silent(device, q):
    assert np.isfinite(rotate(checked, q, device)).all()


# The vector part of q v q*, of the vector part u and the real part w.
def test_release_launches_scale(device):
    u, w, v = np.array([0.2, -0.4, 0.6]), 1.5, np.array([1.0, 2.0, 3.0])
    exact = (w * w - u @ u) * v + 2 * (u @ v) * u + 2 * w * np.cross(u, v)
    np.testing.assert_allclose(rotate(plain, (*u, w), device), exact, rtol=1e-6)
