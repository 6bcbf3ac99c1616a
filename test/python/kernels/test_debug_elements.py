"""Debug mode checks components of arrays' elements, in adjoints, too; release mode keeps what is
written within its element."""

import numpy as np
import pytest

import warp as wp


@pytest.fixture
def debug(monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")


@wp.struct
class Held:
    v: wp.vec3
    m: wp.mat22


@wp.kernel
def into_elements(i: int, j: int, a: wp.array(dtype=wp.vec3), m: wp.array(dtype=wp.mat22),
                  s: wp.array(dtype=Held)):  # fmt: skip
    a[0][i] = 7.0
    a[0][i] += 1.0
    m[0][j] = wp.vec2(1.0, 2.0)
    m[0][j, j] = 3.0
    s[0].v[i] = 4.0
    s[0].m[j, j] -= 5.0


def elements(device):
    kinds = (wp.vec3, wp.mat22, Held)
    return [wp.zeros(2, dtype=kind, device=device) for kind in kinds]


@pytest.mark.parametrize("i, j, line", [(3, 0, 2), (-4, 0, 2), (0, 2, 4), (0, -3, 4)])
def test_components_of_elements(device, debug, i, j, line):
    arrays = elements(device)
    with pytest.raises(wp.WarpLaunchError, match="out of bounds for a (vector|matrix)") as caught:
        wp.launch(into_elements, dim=1, inputs=[i, j, *arrays], device=device)
        wp.synchronize()
    place = into_elements.func.__code__.co_firstlineno + line + 1
    assert f"test_debug_elements.py:{place}" in str(caught.value), caught.value


@pytest.mark.parametrize("i, j", [(3, 2), (-4, -3), (1000, 2**31 - 1), (-(2**31), -1000)])
def test_release_mode_leaves_neighbours_alone(device, i, j):
    """An index out of bounds of an element changes at most this element."""
    arrays = elements(device)
    wp.launch(into_elements, dim=1, inputs=[i, j, *arrays], device=device)
    for array in arrays:
        assert array.numpy()[1].tobytes() == bytes(array.numpy()[1].nbytes)


@wp.kernel
def differentiated(i: int, j: int, x: wp.array(dtype=wp.vec3), y: wp.array(dtype=float)):
    v = x[0]
    v[j] = 2.0 * v[i]
    y[0] = wp.dot(v, v)


@pytest.mark.parametrize("i, j", [(3, 0), (0, 3), (-4, 0)])
def test_adjoints(device, debug, i, j):
    """The adjoint of a launch with other indices than those that were in bounds."""
    x = wp.array([wp.vec3(1.0, 2.0, 3.0)], dtype=wp.vec3, requires_grad=True, device=device)
    y = wp.zeros(1, dtype=float, requires_grad=True, device=device)
    y.grad.fill_(1.0)
    adjoint = {"adjoint": True, "adj_inputs": [None, None, x.grad], "adj_outputs": [y.grad]}
    wp.launch(differentiated, 1, [0, -1, x], [y], device=device, **adjoint)
    np.testing.assert_array_equal(x.grad.numpy(), [[2 + 8, 4, 0]])
    with pytest.raises(wp.WarpLaunchError, match="out of bounds for a vector"):
        wp.launch(differentiated, 1, [i, j, x], [y], device=device, **adjoint)
        wp.synchronize()
