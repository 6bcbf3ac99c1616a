"""Drawings of tapes, and the search for gradients that are not finite."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def root(x: wp.array(dtype=float), shift: float, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 1.0 / (x[i] - shift)


def recorded(device, shift=10.0):
    x = wp.array([1.0, 2.0, 3.0], dtype=float, requires_grad=True, device=device)
    y, z = wp.zeros_like(x), wp.zeros_like(x)
    with wp.Tape() as tape:
        tape.record_scope_begin("outer", {"step": 3})
        wp.launch(square, 3, [x], [y], device=device)
        wp.launch(square, 3, [x], [y], device=device)
        tape.record_scope_begin("empty")
        tape.record_scope_end()
        tape.record_scope_end()
        wp.launch(root, 3, [y, shift], [z], device=device)
    return tape, x, y, z


def test_drawing(device, tmp_path):
    tape, x, y, z = recorded(device)
    file = tmp_path / "tape.dot"
    text = tape.visualize(str(file), array_labels={x: "positions"}, track_outputs=[z])
    assert file.read_text(encoding="utf-8") == text
    assert text.startswith("digraph") and text.count("{") == text.count("}")
    assert 'label="outer"' in text and "step=3" in text and "empty" not in text
    assert 'label="square, repeated 2x"' in text and 'label="root"' in text
    assert 'label="positions"' in text
    assert text.count(" -> ") == 4
    assert text.count("penwidth") == 1
    assert "rankdir=LR" in text


def test_drawing_in_detail(device):
    tape, x, y, z = recorded(device)
    text = tape.visualize(
        simplify_graph=False,
        hide_readonly_arrays=True,
        ignore_graph_scopes=True,
        graph_direction="TB",
    )
    assert text.count('label="square"') == 2 and "subgraph" not in text
    assert text.count(" -> ") == 4 and "rankdir=TB" in text


def test_scopes_have_to_be_open():
    with pytest.raises(wp.WarpError, match="no scope is open"):
        wp.Tape().record_scope_end()


def test_the_first_gradient_that_is_not_finite(device):
    tape, x, y, z = recorded(device, shift=4.0)
    one = wp.ones(3, dtype=float, device=device)
    tape.backward(grads={z: one})
    assert not np.isfinite(x.grad.numpy()).all()
    tape.zero()
    with pytest.raises(RuntimeError) as caught:
        tape.backward(grads={z: one}, check_finite=True)
    text = str(caught.value)
    assert "launch of 'root'" in text and "'x' became -inf at [1]" in text
    assert "x[1] = 4.0" in text and "shift = 4.0" in text and "its gradient was 1.0" in text
    assert "test_tape_reports.py" in text
    assert "it comes from div(" in text and "y[i] = 1.0 / (x[i] - shift)" in text


@wp.kernel
def mixed(x: wp.array(dtype=float), n: int, v: wp.array(dtype=wp.vec3), y: wp.array(dtype=float)):
    i, j = wp.tid()
    s = float(0.0)
    for k in range(n):
        if x[k] > 1.5:
            s += wp.log(x[k] - 2.0)
    y[2 * i + j] = s * wp.length(v[j])


def test_the_operation_in_branches_and_loops(device):
    x = wp.array([1.0, 3.0, 2.0], dtype=float, requires_grad=True, device=device)
    v = wp.ones(2, dtype=wp.vec3, requires_grad=True, device=device)
    y = wp.zeros(4, dtype=float, requires_grad=True, device=device)
    wp.config.singular = "strict"
    try:
        with wp.Tape() as tape:
            wp.launch(mixed, (2, 2), [x, 3, v, y], device=device)
        with pytest.raises(RuntimeError) as caught:
            tape.backward(grads={y: wp.ones(4, dtype=float, device=device)}, check_finite=True)
    finally:
        wp.config.singular = "pinned"
    text = str(caught.value)
    assert "launch of 'mixed'" in text and "it comes from" in text
    assert "s += wp.log(x[k] - 2.0)" in text


def test_seeds_that_are_not_finite(device):
    tape, x, y, z = recorded(device)
    seed = wp.array([1.0, np.nan, 1.0], dtype=float, device=device)
    with pytest.raises(RuntimeError, match=r"'y' is nan at \[1\] before"):
        tape.backward(grads={z: seed}, check_finite=True)


def test_finite_gradients_pass(device):
    tape, x, y, z = recorded(device)
    tape.backward(grads={z: wp.ones(3, dtype=float, device=device)}, check_finite=True)
    start = np.array([1.0, 2.0, 3.0])
    assert np.allclose(x.grad.numpy(), -2 * start / (start**2 - 10) ** 2)
