"""Costs of precision and of inactive elements: gates C11 and C13 of docs/report.md."""

import re

import numpy as np

import warp as wp


@wp.kernel
def decay_half(x: wp.array(dtype=wp.float16), k: float):
    i = wp.tid()
    x[i] = wp.float16(float(x[i]) * wp.exp(-k))


@wp.kernel
def decay(x: wp.array(dtype=float), k: float):
    i = wp.tid()
    x[i] = x[i] * wp.exp(-k)


@wp.kernel
def step_active(
    active: wp.array(dtype=int),
    x: wp.array(dtype=float),
    y: wp.array(dtype=float),
    ran: wp.array(dtype=int),
):
    cell = active[wp.tid()]
    wp.atomic_add(ran, 0, 1)
    y[cell] = x[cell] * x[cell]


# C11: an array is as wide as it was asked for, in memory and in loads; what is computed is not.
def test_precision_is_that_of_each_array(device):
    start = np.random.default_rng(0).uniform(0.5, 2.0, 4096)
    narrow = wp.array(start, dtype=wp.float16, device=device)
    wide = wp.array(start, dtype=float, device=device)
    assert 2 * narrow.size * narrow.strides[0] == wide.size * wide.strides[0]
    for one, kernel, target in ((narrow, decay_half, 2.0**-10), (wide, decay, 2.0**-22)):
        wp.launch(kernel, 4096, [one, 0.3], device=device)
        error = np.abs(one.numpy().astype(np.float64) / (start * np.exp(-0.3)) - 1.0).max()
        assert error < target
    text = decay_half.ir("ptx", arch=90)
    assert re.search(r"ld\.global\S*\.[bu]16", text) and not re.search(r"\.f64", text)


# C13: a list of active cells bounds the threads that run, forward and backward.
def test_work_is_that_of_active_cells(device):
    count, chosen = 10000, np.arange(0, 10000, 97)
    x = wp.array(np.linspace(1.0, 2.0, count), dtype=float, device=device, requires_grad=True)
    y = wp.zeros(count, dtype=float, device=device, requires_grad=True)
    for active in (chosen, chosen[:0]):
        ran = wp.zeros(1, dtype=int, device=device)
        cells = wp.array(active, dtype=int, device=device)
        with wp.Tape() as tape:
            wp.launch(step_active, len(active), [cells, x, y, ran], device=device)
        assert int(ran.numpy()[0]) == len(active)
        tape.backward(grads={y: wp.ones(count, dtype=float, device=device)})
        expected = np.zeros(count)
        expected[active] = 2 * x.numpy()[active]
        np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-6)
        tape.zero()
