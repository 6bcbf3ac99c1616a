"""Kernels with derivatives of functions, compiled by several threads side by side."""

import threading

import numpy as np

import warp as wp


def make(number):
    @wp.func
    def power(x: float):
        return wp.pow(x, float(wp.static(number + 2)))

    @wp.kernel(module="unique")
    def slope(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = wp.grad(power)(x[i])

    return slope


def test_threads_share_no_passes(device, fresh_cache):
    values = np.linspace(0.5, 2.0, 20, dtype=np.float32)
    ahead, own = [make(n) for n in range(8)], [make(n) for n in range(8, 16)]
    thread = threading.Thread(target=wp.compile, args=(ahead, device))
    thread.start()
    exact = values.astype(float)
    for n, kernel in enumerate(own, 10):
        x = wp.array(values, dtype=float, device=device, requires_grad=True)
        y = wp.zeros(20, dtype=float, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(kernel, 20, [x], [y], device=device)
        tape.backward(grads={y: wp.full(20, 1.0, dtype=float, device=device)})
        np.testing.assert_allclose(y.numpy(), n * exact ** (n - 1), rtol=2e-5)
        np.testing.assert_allclose(x.grad.numpy(), n * (n - 1) * exact ** (n - 2), rtol=2e-5)
    thread.join()
    for n, kernel in enumerate(ahead, 2):
        x, y = wp.array(values, dtype=float, device=device), wp.zeros(20, device=device)
        wp.launch(kernel, 20, [x], [y], device=device)
        np.testing.assert_allclose(y.numpy(), n * exact ** (n - 1), rtol=2e-5)
