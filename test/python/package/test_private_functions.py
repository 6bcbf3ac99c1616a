"""Functions of the peer's runtime object that engines call (`warp._src.compat.core`)."""

import ctypes
import subprocess
import sys

import numpy as np
import pytest
import warp._src.context as context

import warp as wp

wp.init()
turn = wp.transform(wp.vec3(1.0, 2.0, 3.0), wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), 0.5))


@pytest.mark.parametrize(
    ("name", "arguments", "result", "expected"),
    [
        ("mul_transformf_transformf", (turn, turn), wp.transform(), turn * turn),
        ("transform_inverse_transformf", (turn,), wp.transform(), wp.transform_inverse(turn)),
        (
            "transform_point_transformf_vec3f",
            (turn, wp.vec3(1.0, 0.0, 0.0)),
            wp.vec3(),
            (1.0 + np.cos(0.5), 2.0 + np.sin(0.5), 3.0),
        ),
        ("quat_from_matrix_mat44f", (wp.mat44(*np.eye(4).ravel()),), wp.quat(), (0, 0, 0, 1)),
        ("dot_vec3f_vec3f", (wp.vec3(1.0, 2.0, 3.0),) * 2, ctypes.c_float(), 14.0),
        ("min_float32_float32", (ctypes.c_float(3.0), 2.0), ctypes.c_float(), 2.0),
    ],
)
def test_builtins_write_where_they_are_told(name, arguments, result, expected):
    getattr(context.runtime.core, f"wp_builtin_{name}")(*arguments, ctypes.byref(result))
    found = getattr(result, "value", result)
    np.testing.assert_allclose(np.asarray(found), np.asarray(expected), rtol=1e-6)


def test_sums_of_products_by_address():
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (100, 3)).astype(np.float32)
    a = wp.array(x, dtype=wp.vec3, device="cpu")
    out = wp.zeros(2, dtype=float, device="cpu")
    context.runtime.core.wp_array_inner_float_host(a.ptr, a[1:].ptr, out.ptr + 4, 50, 24, 12, 3)
    exact = np.sum(x[0:100:2].astype(np.float64) * x[1:51])
    np.testing.assert_allclose(out.numpy(), [0.0, exact], rtol=1e-6)


def test_runtime_is_there_once_it_has_started():
    program = (
        "import warp as wp, warp._src.context as context\n"
        "assert context.runtime is None\n"
        "wp.init()\n"
        "assert context.runtime.cpu_device == wp.get_device('cpu')\n"
    )
    assert subprocess.run([sys.executable, "-c", program]).returncode == 0


@pytest.mark.parametrize("name", ["wp_builtin_", "wp_builtin_no_such", "wp_mesh_create_host"])
def test_other_functions_are_not_there(name):
    with pytest.raises(AttributeError, match=name):
        getattr(context.runtime.core, name)
