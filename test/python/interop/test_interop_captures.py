"""Other libraries work when they are called, and not when a captured graph is launched."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


EXPORTS = {
    "numpy.from_dlpack": np.from_dlpack,
    "to_dlpack": wp.to_dlpack,
    "torch": lambda a: wp.to_torch(a).add_(1.0),
    "jax": lambda a: wp.to_jax(a) + 1.0,
}


@pytest.mark.parametrize("name", EXPORTS)
def test_what_captured_work_writes_is_not_lent(name):
    """The CPU's memory that a captured launch or fill writes is not there yet."""
    if name in ("torch", "jax"):
        pytest.importorskip(name)
    x, y, z = (wp.array([1.0, 2.0], dtype=float, device="cpu") for _ in range(3))
    with wp.ScopedCapture(device="cpu") as capture:
        wp.launch(square, 2, [x, y], device="cpu")
        z.fill_(3.0)
        for written in (y, y[:1], z):
            with pytest.raises(wp.WarpError, match="being captured"):
                EXPORTS[name](written)
        np.testing.assert_array_equal(np.from_dlpack(x), [1.0, 2.0])
    x.fill_(4.0)
    wp.capture_launch(capture.graph)
    np.testing.assert_array_equal(np.from_dlpack(y), [16.0, 16.0])
    EXPORTS[name](y)
