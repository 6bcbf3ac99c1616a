"""Functions and kernels of `fem.cache` are made once per suffix."""

import warp as wp
from warp.fem.cache import dynamic_func, dynamic_kernel


def shift_by(offset, dtype=float):
    @dynamic_func(suffix=offset, allow_overloads=True)
    def shift(x: dtype):
        return x + x.dtype(offset) if wp.static(hasattr(dtype, "_shape_")) else x + dtype(offset)

    return shift


def kernel_for(offset, **options):
    function = shift_by(offset)

    @dynamic_kernel(suffix=offset, kernel_options=options)
    def run(x: wp.array(dtype=float)):
        i = wp.tid()
        x[i] = function(x[i])

    return run


def test_kernels_are_shared_by_suffix_and_options():
    first, second = kernel_for(1.0), kernel_for(2.0)
    assert kernel_for(1.0) is first and second is not first
    assert kernel_for(1.0, enable_backward=False) is not first
    x = wp.zeros(2, dtype=float, device="cpu")
    for kernel in (first, second, first):
        wp.launch(kernel, 2, [x], device="cpu")
    assert x.numpy().tolist() == [4.0, 4.0]


def test_functions_get_overloads():
    function = shift_by(3.0)
    assert shift_by(3.0, wp.float64) is function
    assert shift_by(3.0, wp.float64) is function

    @wp.kernel(module="unique")
    def both(x: wp.array(dtype=float), y: wp.array(dtype=wp.float64)):
        x[0] = function(x[0])
        y[0] = function(y[0])

    x, y = (wp.zeros(1, dtype=t, device="cpu") for t in (wp.float32, wp.float64))
    wp.launch(both, 1, [x, y], device="cpu")
    assert x.numpy()[0] == 3.0 and y.numpy()[0] == 3.0
