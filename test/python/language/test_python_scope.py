"""Builtins called from plain Python give what kernels get."""

import math

import numpy as np
import pytest

import warp as wp


def test_numbers():
    assert wp.sin(0.5) == pytest.approx(math.sin(0.5), rel=1e-6)
    assert wp.sqrt(wp.float64(2.0)) == math.sqrt(2.0)
    assert wp.abs(-3) == 3 and wp.min(2, 1) == 1 and wp.clamp(5.0, 0.0, 1.0) == 1.0
    assert isinstance(wp.floor(1.5), float) and isinstance(wp.max(1, 2), int)
    assert wp.isnan(float("nan")) is True


def test_composites():
    assert wp.dot(wp.vec3(1, 2, 3), wp.vec3(1, 1, 1)) == 6.0
    assert wp.cross(wp.vec3(1, 0, 0), wp.vec3(0, 1, 0)) == (0, 0, 1)
    assert wp.normalize(wp.vec3(0, 3, 4)) == (0, np.float32(0.6), np.float32(0.8))
    assert wp.transpose(wp.mat22(1, 2, 3, 4)) == wp.mat22(1, 3, 2, 4)
    assert type(wp.quat_rotate(wp.quat(0, 0, 1, 0), wp.vec3(1, 0, 0))) is wp.vec3


def test_keywords():
    assert wp.clamp(5.0, low=0.0, high=1.0) == 1.0
    with pytest.raises(TypeError, match="colour"):
        wp.clamp(5.0, colour=1.0)


def test_errors():
    with pytest.raises(TypeError, match="dot"):
        wp.dot(wp.vec3(), wp.vec2())
    with pytest.raises(TypeError, match="list"):
        wp.dot([1, 2], [3, 4])
    with pytest.raises(RuntimeError, match="in kernels only"):
        wp.tid()


def test_documentation():
    assert wp.sin.__doc__ and wp.sin.group and wp.sin.signatures
    assert wp.sin is wp.sin


def test_numbers_of_numpy():
    angles = np.array([0.1, 0.2, 0.3])
    expected = wp.quat_rpy(0.1, 0.2, 0.3)
    assert wp.quat_rpy(*angles.astype(np.float32)) == expected
    assert wp.quat_rpy(*angles) == wp.quat_rpy(*map(wp.float64, angles))
    assert type(wp.quat_rpy(*angles)) is wp.quatd and np.allclose(wp.quat_rpy(*angles), expected)
    assert wp.sin(np.float64(0.5)) == math.sin(0.5)


def test_scalar_types_by_dtype():
    table = wp.types.np_dtype_to_warp_type
    for dtype in (np.float16, np.float64, np.int8, np.uint64, np.bool_):
        assert table[np.dtype(dtype)] is table[dtype] is wp.dtype_from_numpy(dtype)
    assert wp.types.type_is_array(wp.array) and not wp.types.type_is_array(wp.vec3)


def test_arguments_that_are_changed():
    for dtype in (wp.float32, wp.float64):
        t = wp.types.transformation(dtype)()
        vec, quat = wp.types.vector(3, dtype), wp.types.quaternion(dtype)
        assert wp.transform_set_translation(t, vec(1, 2, 3)) is None
        wp.transform_set_rotation(t, quat(4, 5, 6, 7))
        assert list(t) == [1, 2, 3, 4, 5, 6, 7]
    state = wp.uint32(7)
    assert wp.randf(state) == wp.randf(state) and state == wp.uint32(7)


def test_components_of_long_vectors():
    v = wp.types.vector(5, float)(1, 2, 3, 4, 5)
    v.x, v.w = 6.0, v.y
    assert list(v) == [6, 2, 3, 2, 5]
    with pytest.raises(AttributeError):
        wp.vec2().z
