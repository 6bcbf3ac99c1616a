"""Gradients through atomic minima and maxima of what threads compute in loops and branches.

Expected values are those of NumPy: the gradient of an element goes to the thread whose number it
is, and from there through the formula of that number.
"""

import numpy as np
import pytest

import warp as wp

ROWS, COLUMNS, GROUPS = 61, 7, 9


@wp.kernel
def least_norms(
    x: wp.array2d(dtype=wp.float64),
    w: wp.array(dtype=wp.float64),
    group: wp.array(dtype=int),
    rows: int,
    least: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    if i >= rows:
        return
    s = wp.float64(0.0)
    for j in range(x.shape[1]):
        s += w[j] * x[i, j] * x[i, j]
    wp.atomic_min(least, group[i], wp.sqrt(s))


@wp.kernel
def norms_and_least(
    x: wp.array2d(dtype=wp.float64),
    w: wp.array(dtype=wp.float64),
    group: wp.array(dtype=int),
    rows: int,
    least: wp.array(dtype=wp.float64),
    norms: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    if i >= rows:
        return
    s = wp.float64(0.0)
    for j in range(x.shape[1]):
        s += w[j] * x[i, j] * x[i, j]
    norms[i] = s
    wp.atomic_min(least, group[i], wp.sqrt(s))


@wp.kernel
def two_ends(
    x: wp.array(dtype=wp.float64),
    least: wp.array(dtype=wp.float64),
    most: wp.array(dtype=wp.float64),
):
    i = wp.tid()
    v = x[i] * x[i]
    wp.atomic_min(least, 0, v)
    wp.atomic_max(most, 0, v)


@wp.kernel
def least_pairs(
    x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64), least: wp.array(dtype=wp.float64)
):
    i = wp.tid()
    for j in range(y.shape[0]):
        d = x[i] - y[j]
        wp.atomic_min(least, j, d * d)


def given(values, device, dtype=wp.float64):
    return wp.array(values, dtype=dtype, device=device, requires_grad=dtype is wp.float64)


def case(device):
    random = np.random.default_rng(5)
    x, w = random.uniform(0.5, 2.0, (ROWS, COLUMNS)), random.uniform(0.5, 2.0, COLUMNS)
    group = np.r_[np.arange(GROUPS), random.integers(0, GROUPS, ROWS - GROUPS)]
    sums = x * x @ w
    winners = [min(np.flatnonzero(group == g), key=lambda i: sums[i]) for g in range(GROUPS)]
    seeds = random.uniform(0.5, 1.5, GROUPS)
    cotangent = np.zeros(ROWS)
    cotangent[winners] = seeds / (2.0 * np.sqrt(sums[winners]))
    arrays = given(x, device), given(w, device), given(group.astype(np.int32), device, int)
    return x, w, arrays, seeds, cotangent


@pytest.mark.parametrize("stores", [False, True])
def test_gradient_of_least_norms(stores, device):
    x, w, arrays, seeds, cotangent = case(device)
    least = given(np.full(GROUPS, 1e9), device)
    norms = given(np.zeros(ROWS), device)
    kernel, outputs = (norms_and_least, [least, norms]) if stores else (least_norms, [least])
    with wp.Tape() as tape:
        wp.launch(kernel, ROWS + 3, [*arrays, ROWS], outputs, device=device)
    grads = {least: given(seeds, device)}
    if stores:
        grads[norms] = given(np.full(ROWS, 0.25), device)
        cotangent = cotangent + 0.25
    tape.backward(grads=grads)
    wanted = 2.0 * cotangent[:, None] * w * x
    np.testing.assert_allclose(arrays[0].grad.numpy(), wanted, rtol=1e-13)
    np.testing.assert_allclose(arrays[1].grad.numpy(), cotangent @ (x * x), rtol=1e-13)


def test_both_ends(device):
    values = np.random.default_rng(3).uniform(0.5, 2.0, 100)
    x, least, most = (given(v, device) for v in (values, [1e9], [0.0]))
    with wp.Tape() as tape:
        wp.launch(two_ends, 100, [x], [least, most], device=device)
    tape.backward(grads={least: given([2.0], device), most: given([3.0], device)})
    wanted = np.zeros(100)
    wanted[values.argmin()] = 4.0 * values.min()
    wanted[values.argmax()] = 6.0 * values.max()
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-13)


def test_least_of_each_iteration(device):
    random = np.random.default_rng(4)
    a, b = random.uniform(0.0, 1.0, 50), random.uniform(0.0, 1.0, 6)
    x, y, least = given(a, device), given(b, device), given(np.full(6, 1e9), device)
    with wp.Tape() as tape:
        wp.launch(least_pairs, 50, [x, y], [least], device=device)
    tape.backward(grads={least: given(np.ones(6), device)})
    nearest = np.abs(a[:, None] - b).argmin(axis=0)
    slopes = 2.0 * (a[nearest] - b)
    wanted = np.zeros(50)
    np.add.at(wanted, nearest, slopes)
    np.testing.assert_allclose(x.grad.numpy(), wanted, rtol=1e-13)
    np.testing.assert_allclose(y.grad.numpy(), -slopes, rtol=1e-13)
