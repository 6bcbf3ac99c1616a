"""`gradcheck`, `jacobian` and `jacobian_fd`."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def products(x: wp.array(dtype=wp.vec2), s: float, y: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    y[i] = s * wp.vec3(x[i][0], x[i][1], x[i][0] * x[i][1])


@wp.kernel
def grow(x: wp.array(dtype=wp.float64)):
    i = wp.tid()
    x[i] = x[i] * x[i]


@wp.func
def wrong(x: float):
    return x * x


@wp.func_grad(wrong)
def adj_wrong(x: float, adj: float):
    wp.adjoint[x] += 3.0 * x * adj


@wp.kernel
def apply_wrong(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = wrong(x[i])


def arguments(device):
    x = wp.array([[1.0, 2.0], [3.0, 4.0]], dtype=wp.vec2, requires_grad=True, device=device)
    y = wp.zeros(2, dtype=wp.vec3, requires_grad=True, device=device)
    return x, y


EXPECTED = np.array(
    [
        [[2, 0], [0, 0]],
        [[0, 2], [0, 0]],
        [[4, 2], [0, 0]],
        [[0, 0], [2, 0]],
        [[0, 0], [0, 2]],
        [[0, 0], [8, 6]],
    ]
)


def test_jacobian_of_a_kernel(device):
    x, y = arguments(device)
    found = wp.autograd.jacobian(products, 2, [x, 2.0], [y])
    assert list(found) == [(0, 0)]
    assert found[0, 0].dtype is wp.vec2 and found[0, 0].shape == (6, 2)
    assert np.array_equal(found[0, 0].numpy(), EXPECTED)


def test_jacobian_by_differences(device):
    x, y = arguments(device)
    found = wp.autograd.jacobian_fd(products, 2, [x, 2.0], [y], eps=1e-2)
    assert found[0, 0].shape == (6, 2)
    assert np.allclose(found[0, 0].numpy(), EXPECTED, atol=1e-3)
    some = wp.autograd.jacobian_fd(products, 2, [x, 2.0], [y], max_inputs_per_var=1)
    assert np.isnan(some[0, 0].numpy()).sum() == 18


def test_rows_that_are_left_out(device):
    x, y = arguments(device)
    found = wp.autograd.jacobian(products, 2, [x, 2.0], [y], max_outputs_per_var=2)
    assert np.array_equal(found[0, 0].numpy()[:2], EXPECTED[:2])
    assert np.isnan(found[0, 0].numpy()[2:]).all()


def test_python_functions(device):
    x, _ = arguments(device)

    def function(x, s):
        y = wp.zeros(2, dtype=wp.vec3, requires_grad=True, device=device)
        wp.launch(products, 2, [x, s], [y], device=device)
        return y, x * 3.0

    found = wp.autograd.jacobian(function, inputs=[x, 2.0])
    assert np.array_equal(found[0, 0].numpy(), EXPECTED)
    assert np.array_equal(found[0, 1].numpy().reshape(4, 4), 3 * np.eye(4))
    only = wp.autograd.jacobian(function, inputs=[x, 2.0], input_output_mask=[("x", 1)])
    assert list(only) == [(0, 1)]
    assert wp.autograd.gradcheck(function, inputs=[x, 2.0], eps=1e-2, show_summary=False)


def test_arrays_that_a_kernel_updates(device):
    x = wp.array([2.0, 3.0], dtype=wp.float64, requires_grad=True, device=device)
    found = wp.autograd.jacobian(grow, 2, [x])
    assert np.array_equal(found[0, 0].numpy(), [[4, 0], [0, 6]])
    assert wp.autograd.gradcheck(grow, 2, [x], rtol=1e-6, atol=1e-6, show_summary=False)
    assert np.array_equal(x.numpy(), [2, 3])


def test_wrong_gradients_are_found(device, capsys):
    x = wp.array([2.0, 5.0], dtype=float, requires_grad=True, device=device)
    y = wp.zeros_like(x)
    with pytest.raises(ValueError, match="apply_wrong") as caught:
        wp.autograd.gradcheck(apply_wrong, 2, [x], [y])
    assert "dy/dx" in str(caught.value) and "adjoint 15" in str(caught.value)
    assert "differ" in capsys.readouterr().out
    assert not wp.autograd.gradcheck(apply_wrong, 2, [x], [y], raise_exception=False)
    with wp.Tape() as tape:
        wp.launch(apply_wrong, 2, [x], [y], device=device)
    assert wp.autograd.gradcheck_tape(tape, blacklist_kernels=["apply_wrong"])
    with pytest.raises(ValueError, match="launch of 'apply_wrong'"):
        wp.autograd.gradcheck_tape(tape)


def test_gradients_of_all_launches_of_a_tape(device, capsys):
    x, y = arguments(device)
    with wp.Tape() as tape:
        wp.launch(products, 2, [x, 2.0], [y], device=device)
        wp.launch(products, 1, [x, 1.0], [y], device=device)
    assert wp.autograd.gradcheck_tape(tape, eps=1e-2, reverse_launches=True)
    assert capsys.readouterr().out.count("agree") == 2
    assert wp.autograd.gradcheck_tape(tape, skip_to_launch_index=2)


def test_missing_gradients_are_named(device):
    x, y = arguments(device)
    x.requires_grad = False
    with pytest.raises(RuntimeError, match="no input of 'products'"):
        wp.autograd.jacobian(products, 2, [x, 2.0], [y])
    x, y = arguments(device)
    y.requires_grad = False
    with pytest.raises(RuntimeError, match="no output of 'products'"):
        wp.autograd.jacobian(products, 2, [x, 2.0], [y])
    with pytest.raises(ValueError, match="names no pair"):
        wp.autograd.jacobian(
            products,
            2,
            list(arguments(device)[:1]) + [2.0],
            [arguments(device)[1]],
            input_output_mask=[("z", "y")],
        )


def test_picture(device):
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    x, y = arguments(device)
    found = wp.autograd.jacobian(products, 2, [x, 2.0], [y])
    figure = wp.autograd.jacobian_plot(found, products, show_plot=False)
    assert figure.axes[0].get_xlabel() == "x"
    plt.close(figure)


def test_metrics():
    found = wp.autograd.adjoint_metrics(products)
    assert {"tape_bytes", "replay_loops", "atomics", "block_reductions", "shadowed"} <= set(found)
    assert found["tape_bytes"] == 0
