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


@pytest.fixture
def plt():
    found = pytest.importorskip("matplotlib.pyplot")
    found.switch_backend("Agg")
    yield found
    found.close("all")


def test_picture_of_a_kernel(device, plt):
    x, y = arguments(device)
    found = wp.autograd.jacobian(products, 2, [x, 2.0], [y])
    figure = wp.autograd.jacobian_plot(found, products, [x, 2.0], show_plot=False)
    assert figure.get_suptitle() == "products kernel Jacobian"
    picture, scale = figure.axes
    assert picture.get_xlabel() == "x" and picture.get_ylabel() == "y"
    assert np.array_equal(picture.images[0].get_array(), found[0, 0].numpy().reshape(6, 4))
    assert picture.images[0].norm.vmin == -np.abs(found[0, 0].numpy()).max()
    with pytest.raises(ValueError, match="inputs must be provided"):
        wp.autograd.jacobian_plot(found, products, show_plot=False)
    assert wp.autograd.jacobian_plot({}, products, [x, 2.0], show_plot=False) is None


def test_picture_of_several_jacobians(plt):
    narrow, wide = (wp.array(np.ones((3, n)), dtype=float, device="cpu") for n in (2, 5))
    labels = wp.autograd.FunctionMetadata("f", ["a", "b"], {10: "r", 2: "s"})
    found = {(0, 10): narrow, (1, 2): wide}
    figure = wp.autograd.jacobian_plot(found, labels, show_plot=False, show_colorbar=False)
    shown = [(one.get_xlabel(), one.get_ylabel()) for one in figure.axes if one.axison]
    assert shown == [("b", "s"), ("a", "r")] and len(figure.axes) == 4
    grid = figure.axes[0].get_gridspec()
    assert grid.get_width_ratios() == [2, 5] and grid.get_height_ratios() == [3, 3]
    unnamed = wp.autograd.FunctionMetadata(input_labels=["a", "b"])
    figure = wp.autograd.jacobian_plot({(0, 1): narrow}, unnamed, show_plot=False)
    assert figure.get_suptitle() == "unknown kernel Jacobian"
    assert figure.axes[0].get_ylabel() == "output_1"
    for labels in ({"input_labels": ["a"]}, {"input_labels": ["a", None]}):
        metadata = wp.autograd.FunctionMetadata(**labels)
        with pytest.raises(ValueError, match="Jacobian input index 1: missing label"):
            wp.autograd.jacobian_plot({(1, 0): narrow}, metadata, show_plot=False)


def test_pictures_of_errors(plt, monkeypatch):
    shown = []
    monkeypatch.setattr(plt, "show", lambda: shown.append(plt.gcf().get_suptitle()))
    x, y = arguments("cpu")
    errors = {"plot_relative_error": True, "plot_absolute_error": True, "show_summary": False}
    assert wp.autograd.gradcheck(products, 2, [x, 2.0], [y], **errors)
    title = "products kernel Jacobian"
    assert shown == [f"{title} relative error", f"{title} absolute error"]


def test_launches_without_derivatives_are_left_out():
    x, y = arguments("cpu")
    with wp.Tape() as tape:
        wp.launch(products, 2, [x, 2.0], [y], device="cpu")
    products.options["enable_backward"] = False
    try:
        with pytest.raises(ValueError, match="`enable_backward=False`"):
            wp.autograd.gradcheck(products, 2, [x, 2.0], [y])
        assert wp.autograd.gradcheck_tape(tape)
    finally:
        del products.options["enable_backward"]


def test_metrics():
    found = wp.autograd.adjoint_metrics(products)
    assert {"tape_bytes", "replay_loops", "atomics", "block_reductions", "shadowed"} <= set(found)
    assert found["tape_bytes"] == 0
