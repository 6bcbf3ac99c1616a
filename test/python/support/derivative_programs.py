"""Helpers of tests of derivatives."""

import warp as wp


def gradients(kernel, n, inputs, outputs, device="cpu"):
    """Launches on a tape and goes backward with seeds of 1."""
    with wp.Tape() as tape:
        wp.launch(kernel, n, inputs, outputs, device=device)
    tape.backward(grads={o: wp.ones(o.shape, dtype=o.dtype, device=device) for o in outputs})


def variable(data, device, dtype=float):
    return wp.array(data, dtype=dtype, device=device, requires_grad=True)


def result(n, device, dtype=float):
    return wp.zeros(n, dtype=dtype, device=device, requires_grad=True)
