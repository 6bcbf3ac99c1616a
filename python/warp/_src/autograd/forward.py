"""`jvp`, `hvp` and `hessian`: derivatives along directions, first and second."""

from __future__ import annotations

import typing
from collections.abc import Callable, Sequence

from warp._src import errors
from warp._src.argument_kinds import CALLABLE, LIST
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.arrays.casts import casted
from warp._src.arrays.copies import clone, copy
from warp._src.arrays.create import zeros, zeros_like
from warp._src.arrays.gradients import gradient_type
from warp._src.arrays.observers import Observers, Observing, copy_layout
from warp._src.autograd.evaluation import components, numbers_of, set_numbers
from warp._src.autograd.tangents import Tangents, chunks
from warp._src.derivatives.tape import Tape


@checked(function=CALLABLE, inputs=LIST, tangents=LIST)
def jvp(function: Callable, inputs: Sequence, tangents: Sequence) -> typing.Any:
    """The derivative of a function along a direction, or along several, by forward mode.

    Each launch in the function is replaced by one that computes values and tangents together, so it
    costs about two evaluations, however many outputs there are. Several directions share the
    evaluation of values, eight at a time; for more of them the function is called again, with what
    it has overwritten put back. Inside of a tape's block the tangents are recorded too, for
    derivatives of them.

    Args:
        function: a Python function that launches kernels and returns an array or several.
        inputs: its arguments.
        tangents: for each input an array like it, or None for zeros. Arrays of one more dimension,
            the first, hold one tangent for each of `k` directions, the same number for all inputs.

    Returns:
        The tangent of each returned array, as a list if the function returns a list or tuple. With
        several directions, an array of shape `(k, *shape)` for a returned array of shape `shape`.

    Example:
        >>> import warp as wp
        >>> x = wp.array([1.0, 2.0], dtype=float, device="cpu")
        >>> v = wp.array([1.0, 10.0], dtype=float, device="cpu")
        >>> print(wp.autograd.jvp(lambda x: x * x, inputs=[x], tangents=[v]))
        [ 2. 40.]
        >>> units = wp.array([[1.0, 0.0], [0.0, 1.0]], dtype=float, device="cpu")
        >>> print(wp.autograd.jvp(lambda x: x * x, inputs=[x], tangents=[units]))
        [[2. 0.]
         [0. 4.]]

    Raises:
        WarpShapeError: a tangent does not fit its input, numbers of directions differ, or there are
            several and a returned array has four dimensions.
        WarpCodegenError: a kernel cannot be differentiated.
    """
    directions, is_batch = _directions(inputs, tangents, "tangents")
    made: list = []
    state = None
    for part, width in chunks(len(directions)):
        state = Tangents(Observers.tape, width, state, part.stop == len(directions))
        _start(state, inputs, directions[part.start : part.stop])
        with Observing(tape=None, executor=state):
            result = function(*inputs)
        results = list(result) if isinstance(result, (list, tuple)) else [result]
        for one in results:
            if not isinstance(one, array):
                raise TypeError(f"jvp: expects a function that returns arrays, but got {one!r}")
        found = [[state.find(one, i) for one in results] for i in range(len(part))]
        if not is_batch:
            pairs = zip(results, found[0], strict=True)
            made = [zeros_like(a, requires_grad=False) if t is None else clone(t) for a, t in pairs]
        else:
            made = made or [
                _rows(one, len(directions), Observers.tape is not None) for one in results
            ]
            for k, tangents_of_one in zip(part, found, strict=True):
                _set_row(made, k, tangents_of_one)
    return made if isinstance(result, (list, tuple)) else made[0]


@checked(function=CALLABLE, inputs=LIST, vectors=LIST)
def hvp(function: Callable, inputs: Sequence, vectors: Sequence) -> typing.Any:
    """The Hessian of a function times a vector, or several, by forward mode over reverse mode.

    Several vectors share the evaluation of values and gradients, as tangents do in `jvp`. For a
    function with a derivative of its own, the second one is that of its pullback.

    Args:
        function: a Python function that launches kernels and returns an array of one element.
        inputs: its arguments; derivatives are taken by those with `requires_grad`. Gradients of
            arrays are left as they were.
        vectors: for each input an array like it, or None for zeros. Arrays of one more dimension,
            the first, hold `k` vectors, the same number for all inputs.

    Returns:
        For each input the second derivative by it and along the vectors, None without
        `requires_grad`; the array itself if there is one input. With several vectors, an array of
        shape `(k, *shape)` for an input of shape `shape`.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def cubes(x: wp.array(dtype=float), loss: wp.array(dtype=float)):
        ...     i = wp.tid()
        ...     wp.atomic_add(loss, 0, x[i] * x[i] * x[i])
        >>> def f(x):
        ...     loss = wp.zeros(1, dtype=float, requires_grad=True, device="cpu")
        ...     wp.launch(cubes, 2, [x, loss], device="cpu")
        ...     return loss
        >>> x = wp.array([1.0, 2.0], dtype=float, requires_grad=True, device="cpu")
        >>> v = wp.array([1.0, 1.0], dtype=float, device="cpu")
        >>> print(wp.autograd.hvp(f, inputs=[x], vectors=[v]))
        [ 6. 12.]

    Raises:
        WarpShapeError: a vector does not fit its input, or numbers of vectors differ.
        WarpCodegenError: a kernel cannot be differentiated twice.
    """
    chosen = _differentiated("hvp", inputs)
    directions, is_batch = _directions(inputs, vectors, "vectors")
    made: list = [None] * len(inputs)
    if is_batch:
        for i in chosen:
            made[i] = _rows(inputs[i], len(directions), False)
    for k, found in _second_derivatives(function, inputs, chosen, directions):
        for i, tangent in zip(chosen, found, strict=True):
            if is_batch:
                made[i][k].assign(tangent)
            else:
                made[i] = clone(tangent, requires_grad=False)
    return made[0] if len(made) == 1 else made


@checked(function=CALLABLE, inputs=LIST)
def hessian(function: Callable, inputs: Sequence) -> dict[tuple[int, int], array]:
    """All second derivatives of a function, by forward mode over reverse mode.

    Eight columns are computed at a time, as by `hvp`.

    Args:
        function: a Python function that launches kernels and returns an array of one element.
        inputs: its arguments; derivatives are taken by those with `requires_grad`.

    Returns:
        By (position of an input, position of an input) an array of shape (scalars of the first,
        elements of the second), with elements of the second's type, of 32 bits for those of 16.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def product(x: wp.array(dtype=float), loss: wp.array(dtype=float)):
        ...     loss[0] = x[0] * x[0] * x[1]
        >>> def f(x):
        ...     loss = wp.zeros(1, dtype=float, requires_grad=True, device="cpu")
        ...     wp.launch(product, 1, [x, loss], device="cpu")
        ...     return loss
        >>> x = wp.array([3.0, 4.0], dtype=float, requires_grad=True, device="cpu")
        >>> print(wp.autograd.hessian(f, inputs=[x])[0, 0])
        [[8. 6.]
         [6. 0.]]

    Raises:
        WarpGradientError: no input has a gradient.
        WarpCodegenError: a kernel cannot be differentiated twice.
    """
    chosen = _differentiated("hessian", inputs)
    places = [(i, k) for i in chosen for k in range(inputs[i].size * components(inputs[i].dtype))]
    result = {
        (i, j): zeros(
            (sum(first == i for first, _ in places), inputs[j].size),
            gradient_type(inputs[j].dtype),
            device=inputs[j].device,
        )
        for i in chosen
        for j in chosen
    }
    directions = [
        [_unit(one, k) if position == i else None for position, one in enumerate(inputs)]
        for i, k in places
    ]
    for number, found in _second_derivatives(function, inputs, chosen, directions):
        i, k = places[number]
        for j, tangent in zip(chosen, found, strict=True):
            result[i, j][k].assign(tangent.contiguous().flatten())
    return result


# Directions.


def _directions(inputs, given, name) -> tuple[list, bool]:
    """Per direction one array or None for each input, and whether a batch was given.

    An array of one more dimension than its input is a batch.
    """
    if len(inputs) != len(given):
        raise errors.WarpShapeError(
            f"expects as many {name} as inputs, but got {len(given)} for {len(inputs)}"
        )
    counts = {}
    for i, (one, tangent) in enumerate(zip(inputs, given, strict=True)):
        if tangent is None:
            continue
        if not isinstance(one, array) or not isinstance(tangent, array):
            raise TypeError(f"expects arrays as {name}, but got '{type(tangent).__name__}'")
        if tangent.shape != one.shape and tangent.shape[1:] != one.shape:
            several = ", ".join(["k", *map(str, one.shape)])
            raise errors.WarpShapeError(
                f"expects {name} of shape {one.shape}, or ({several}) for k directions, but got "
                f"{tangent.shape}"
            )
        counts[i] = None if tangent.shape == one.shape else tangent.shape[0]
    if len(set(counts.values())) > 1:
        shown = ", ".join(
            f"{'one' if count is None else count} for input {i}" for i, count in counts.items()
        )
        raise errors.WarpShapeError(f"expects {name} along the same directions, but got {shown}")
    count = next(iter(counts.values()), None)
    if count is None:
        return [list(given)], False
    if count == 0:
        raise errors.WarpShapeError(f"expects {name} along at least one direction, but got none")
    rows = [[None if one is None else one[k] for one in given] for k in range(count)]
    return rows, True


def _unit(one: array, k: int) -> array:
    """A direction along one scalar of an array."""
    result = zeros(one.shape, gradient_type(one.dtype), device=one.device)
    numbers = numbers_of(result)
    numbers[k] = 1
    set_numbers(result, numbers)
    return result


def _start(state: Tangents, inputs, directions) -> None:
    """Gives the inputs their tangents."""
    for i, direction in enumerate(directions):
        for one, tangent in zip(inputs, direction, strict=True):
            if tangent is not None:
                target = state.twin(one, i)
                if tangent.item_size != target.item_size and tangent.dtype is one.dtype:
                    tangent = casted(tangent.to(one.device), target.dtype)
                target.assign(tangent)


def _rows(one: array, count: int, recorded: bool) -> array:
    """Room for the tangents of an array along several directions."""
    if one.ndim == 4:
        raise errors.WarpShapeError(
            f"tangents of an array of shape {one.shape} along {count} directions have too many "
            f"dimensions, pass one direction at a time"
        )
    dtype = gradient_type(one.dtype)
    return zeros((count, *one.shape), dtype, device=one.device, requires_grad=recorded)


def _set_row(made, k, found) -> None:
    for rows, tangent in zip(made, found, strict=True):
        if tangent is not None:
            copy(rows[k], tangent)


# Forward over reverse.


def _differentiated(name, inputs) -> list[int]:
    """Positions of inputs that have a gradient."""
    found = [i for i, one in enumerate(inputs) if isinstance(one, array) and one.requires_grad]
    if not found:
        raise errors.WarpGradientError(
            f"{name}: no input has a gradient", hint="make inputs with `requires_grad=True`"
        )
    return found


def _second_derivatives(function, inputs, chosen, directions):
    """Yields each direction's number and the tangents of the gradients of the chosen inputs."""
    state = None
    for part, width in chunks(len(directions)):
        state = Tangents(None, width, state, part.stop == len(directions))
        _start(state, inputs, directions[part.start : part.stop])
        saved = _run_twice(state, function, inputs)
        for i, number in enumerate(part):
            yield number, [state.twin(inputs[j].grad, i) for j in chosen]
        for grad, contents in saved:
            grad.assign(contents)


def _run_twice(state, function, inputs) -> list:
    """Runs a function forwards and backwards with tangents; gradients as they were before."""
    saved: list = []
    with Observing(tape=None, executor=state):
        with Tape(preserve="auto") as tape:
            loss = function(*inputs)
        if not isinstance(loss, array) or loss.size != 1:
            raise errors.WarpShapeError(
                f"expects a function that returns an array of one element, but got {loss!r}"
            )
        held = [*tape.arrays(), *(one for one in inputs if isinstance(one, array))]
        for grad in {id(one.grad): one.grad for one in held if one.requires_grad}.values():
            saved.append((grad, copy_layout(grad)))
            grad.zero_()
        tape.backward(loss=loss)
    return saved
