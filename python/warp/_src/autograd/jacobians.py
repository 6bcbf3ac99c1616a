"""Jacobians of kernels and of functions that launch kernels."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy

from warp._src.argument_kinds import CALLABLE, INTEGER, LIST, TEXT
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.arrays.create import zeros_like
from warp._src.arrays.gradients import gradient_type
from warp._src.arrays.observers import Observing
from warp._src.autograd.evaluation import (
    Evaluation,
    FunctionMetadata,
    components,
    numbers_of,
    set_numbers,
)
from warp._src.autograd.tangents import Tangents, chunks
from warp._src.derivatives.tape import Tape
from warp._src.derivatives.tape_records import LaunchRecord
from warp._src.kernels.kernel import Kernel
from warp._src.types.numpy_types import element_layout


@checked(
    function=CALLABLE,
    inputs=LIST,
    outputs=LIST,
    input_output_mask=LIST,
    max_blocks=INTEGER,
    max_outputs_per_var=INTEGER,
    mode=TEXT,
)
def jacobian(
    function: Kernel | Callable,
    dim=None,
    inputs: Sequence | None = None,
    outputs: Sequence | None = None,
    input_output_mask: list[tuple[str | int, str | int]] | None = None,
    device=None,
    max_blocks: int = 0,
    block_dim: int | None = None,
    max_outputs_per_var: int = -1,
    plot_jacobians: bool = False,
    metadata: FunctionMetadata | None = None,
    restore_inputs: bool = True,
    mode: str = "reverse",
) -> dict[tuple[int, int], array]:
    """Jacobians, by a backward pass per scalar of outputs or a tangent per scalar of inputs.

    Args:
        function: a kernel, or a Python function that launches kernels.
        dim: extents of the kernel's launch.
        inputs: arguments; those with `requires_grad` are differentiated by.
        outputs: further arguments of a kernel, which it writes; by default what it writes of
            `inputs`. A Python function may return its outputs.
        input_output_mask: pairs of names or positions; others are left out.
        max_outputs_per_var: scalars of each output to do, -1 for all; rows of others are NaN.
        plot_jacobians: show them with `jacobian_plot`.
        metadata: names for the picture.
        restore_inputs: give the arrays their contents back.
        mode: `"reverse"` or `"forward"`. Forward mode is the better one if inputs have fewer
            scalars than outputs, or not many more: it does eight at a time.

    Returns:
        By (position of the input, position of the output) an array of shape (scalars of the
        output, elements of the input), with elements like the input's gradient.

    Raises:
        WarpGradientError: no input or no output has a gradient.
    """
    if mode not in ("reverse", "forward"):
        raise ValueError(f"expects the mode 'reverse' or 'forward', but got {mode!r}")
    find = reverse_rows if mode == "reverse" else forward_columns
    with Evaluation(
        function, dim, inputs, outputs, device, block_dim, metadata, restore_inputs
    ) as problem:
        result = _as_arrays(problem, find(problem, input_output_mask, max_outputs_per_var))
    if plot_jacobians:
        from warp._src.autograd.plots import jacobian_plot

        jacobian_plot(result, metadata or function, inputs)
    return result


@checked(
    function=CALLABLE,
    inputs=LIST,
    outputs=LIST,
    input_output_mask=LIST,
    max_blocks=INTEGER,
    max_inputs_per_var=INTEGER,
)
def jacobian_fd(
    function: Kernel | Callable,
    dim=None,
    inputs: Sequence | None = None,
    outputs: Sequence | None = None,
    input_output_mask: list[tuple[str | int, str | int]] | None = None,
    device=None,
    max_blocks: int = 0,
    block_dim: int | None = None,
    max_inputs_per_var: int = -1,
    eps: float = 1e-4,
    plot_jacobians: bool = False,
    metadata: FunctionMetadata | None = None,
    restore_inputs: bool = True,
) -> dict[tuple[int, int], array]:
    """Jacobians by central differences: two evaluations per scalar of the inputs.

    Arguments and result are those of `jacobian`, besides

    Args:
        max_inputs_per_var: scalars of each input to do, -1 for all; columns of others are NaN.
        eps: step; the difference of the rounded arguments is divided by.
    """
    with Evaluation(
        function, dim, inputs, outputs, device, block_dim, metadata, restore_inputs
    ) as problem:
        columns = difference_columns(problem, input_output_mask, max_inputs_per_var, eps)
        result = _as_arrays(problem, columns)
    if plot_jacobians:
        from warp._src.autograd.plots import jacobian_plot

        jacobian_plot(result, metadata or function, inputs)
    return result


def reverse_rows(problem: Evaluation, mask, limit: int) -> dict[tuple, numpy.ndarray]:
    """Matrices of scalars, found row by row."""
    problem.reset()
    with Observing(tape=None), Tape(preserve="auto") as tape:
        problem.run()
    _check_kernels(tape)
    pairs = problem.pairs(mask)
    result = _unknown(pairs)
    for target in {id(target): target for _, target in pairs}.values():
        sources = [source for source, other in pairs if other is target]
        seed = zeros_like(target.array.grad, requires_grad=False)
        numbers = numbers_of(seed)
        for row in range(target.length if limit < 0 else min(limit, target.length)):
            numbers[:] = 0
            numbers[row] = 1
            set_numbers(seed, numbers)
            for source in sources:
                source.array.grad.zero_()
            tape.zero()
            tape.backward(grads={target.array: seed})
            for source in sources:
                result[source.key, target.key][row] = numbers_of(source.array.grad)
    tape.zero()
    return result


def _check_kernels(tape) -> None:
    """Raises for a kernel that was declared to have no backward pass."""
    for record in tape.launches:
        kernel = record.call.kernel if isinstance(record, LaunchRecord) else None
        if kernel is not None and not kernel.option("enable_backward"):
            raise ValueError(
                "Kernel must have backward pass enabled to compute Jacobians: "
                f"'{kernel.key}' has `enable_backward=False`"
            )


def forward_columns(problem: Evaluation, mask, limit: int) -> dict[tuple, numpy.ndarray]:
    """Matrices of scalars, found several columns at a time."""
    problem.reset()
    with Observing(tape=None):
        problem.run()
    pairs = problem.pairs(mask)
    result = _unknown(pairs)
    sources = {id(source): source for source, _ in pairs}.values()
    columns = [(source, column) for source in sources for column in range(source.length)]
    for part, width in chunks(len(columns)):
        problem.reset()
        state = Tangents(width=width)
        for i, (source, column) in enumerate(columns[part.start : part.stop]):
            tangent = state.twin(source.array, i)
            numbers = numbers_of(tangent)
            numbers[column] = 1
            set_numbers(tangent, numbers)
        with Observing(tape=None, executor=state):
            outputs = {one.key: one.array for one in problem.run()}
        for i, (source, column) in enumerate(columns[part.start : part.stop]):
            for key in [target.key for other, target in pairs if other is source]:
                found = state.find(outputs[key], i)
                result[source.key, key][:, column] = 0 if found is None else numbers_of(found)
    if limit >= 0:
        for matrix in result.values():
            matrix[limit:] = numpy.nan
    return result


def _unknown(pairs) -> dict[tuple, numpy.ndarray]:
    """A matrix of NaN for each pair."""
    return {
        (source.key, target.key): numpy.full(
            (target.length, source.length),
            numpy.nan,
            element_layout(gradient_type(source.array.dtype))[0],
        )
        for source, target in pairs
    }


def difference_columns(problem: Evaluation, mask, limit: int, eps: float) -> dict:
    """Matrices of scalars, found column by column."""
    problem.reset()
    with Observing(tape=None):
        problem.run()
        pairs = problem.pairs(mask)
        result = _unknown(pairs)
        for source in {id(source): source for source, _ in pairs}.values():
            keys = [target.key for other, target in pairs if other is source]
            problem.reset()
            start = numbers_of(source.array)
            for column in range(source.length if limit < 0 else min(limit, source.length)):
                ends = [_evaluate(problem, source, start, column, h) for h in (eps, -eps)]
                step = ends[0][0] - ends[1][0]
                for key in keys:
                    difference = ends[0][1][key] - ends[1][1][key]
                    result[source.key, key][:, column] = difference / step
    return result


def _evaluate(problem, source, start, column, step) -> tuple[float, dict]:
    """The changed argument after rounding, and the outputs by key, in double precision."""
    problem.reset()
    numbers = start.copy()
    numbers[column] += step
    set_numbers(source.array, numbers)
    outputs = problem.run()
    found = {one.key: numbers_of(one.array).astype(numpy.float64) for one in outputs}
    return float(numbers[column]), found


def _as_arrays(problem, matrices) -> dict:
    by_key = {source.key: source.array for source in problem.inputs}
    result = {}
    for (source, target), numbers in matrices.items():
        device, dtype = by_key[source].device, gradient_type(by_key[source].dtype)
        inner = tuple(getattr(dtype, "_shape_", ()))
        shape = (numbers.shape[0], numbers.shape[1] // components(dtype), *inner)
        result[source, target] = array(
            numpy.ascontiguousarray(numbers).reshape(shape), dtype=dtype, device=device
        )
    return result
