"""Functionals - sums over elements by a tree in element order, with the same bits every time."""

import functools

import warp as wp
from warp import extend
from warp._src.fem.assembly.gather import with_scalar

# Numbers that one thread adds.
_FAN = 64


@functools.cache
def _sum_kernel(dtype, wide):
    def partial_sums(values: wp.array(dtype=dtype), count: int, sums: wp.array(dtype=wide)):
        i = wp.tid()
        total = wide()
        for k in range(wp.static(_FAN) * i, wp.min(wp.static(_FAN) * (i + 1), count)):
            total += wide(values[k])
        sums[i] = total

    return wp.kernel(partial_sums, enable_backward=False)


@functools.cache
def _store_kernel(wide, dtype):
    def store(sums: wp.array(dtype=wide), count: int, adds: int, output: wp.array(dtype=dtype)):
        total = wide()
        if adds != 0:
            total = wide(output[0])
        if count > 0:
            total += sums[0]
        output[0] = dtype(total)

    return wp.kernel(store, enable_backward=False)


@functools.cache
def _spread_kernel(dtype, out):
    def spread(adjoint: wp.array(dtype=out), adjoints: wp.array(dtype=dtype)):
        adjoints[wp.tid()] += dtype(adjoint[0])

    return wp.kernel(spread, enable_backward=False)


def sum_totals(totals, accumulate_dtype=wp.float64, output_dtype=None, output=None, add=False):
    """The sum of an array.

    Args:
        totals: the integral over each element: numbers, vectors or matrices.
        accumulate_dtype: scalar type of sums.
        output_dtype: type of the result, by default that of `totals`; its scalar type counts.
        output: array whose first element is set or added to; the result is a number by default.
        add: if the sum is added to the output.

    Returns:
        `output`, or a NumPy value.
    """
    dtype, device = extend.canonical(totals.dtype), totals.device
    wide = with_scalar(dtype, extend.canonical(accumulate_dtype))
    if output is None:
        if add:
            raise ValueError("add=True expects 'output'")
        scalar = extend.type_scalar_type(extend.canonical(output_dtype or dtype))
        result = wp.empty(1, dtype=with_scalar(dtype, scalar), device=device)
    else:
        if output.size < 1 or extend.type_size(output.dtype) != extend.type_size(dtype):
            raise ValueError(
                f"'output' expects an element of {extend.type_size(dtype)} numbers, but got "
                f"{output.size} of type '{extend.type_repr(output.dtype)}'"
            )
        result = output if output.ndim == 1 else output.flatten()
    with extend.unrecorded():
        sums, count = totals, totals.shape[0]
        while True:
            fewer = -(-count // _FAN)
            kernel = _sum_kernel(sums.dtype, wide)
            partial = wp.empty(max(fewer, 1), dtype=wide, device=device)
            wp.launch(kernel, fewer, [sums, count, partial], device=device)
            sums, count = partial, fewer
            if count <= 1:
                break
        inputs = [sums, count, int(add), result]
        wp.launch(_store_kernel(wide, result.dtype), 1, inputs, device=device)
    if output is None:
        return result.numpy()[0]
    if totals.requires_grad and output.requires_grad and extend.is_recording():
        _record(totals, result, add)
    return output


def _record(totals, output, add) -> None:
    def backward():
        kernel = _spread_kernel(extend.canonical(totals.dtype), extend.canonical(output.dtype))
        wp.launch(kernel, totals.shape[0], [output.grad, totals.grad], device=totals.device)
        # The element before was overwritten: it has no gradient.
        if not add:
            output.grad[:1].zero_()

    extend.record_adjoint(backward, [totals, output])
