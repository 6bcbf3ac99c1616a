"""`jvp` and `hvp`: derivatives along directions, first and second."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from warp._src import errors
from warp._src.array import array
from warp._src.array_create import clone, zeros_like
from warp._src.autograd.tangents import Tangents
from warp._src.tape import Tape
from warp._src.tracking import Watch, Watching, copy_layout


def jvp(function: Callable, inputs: Sequence, tangents: Sequence) -> array | list[array]:
    """The derivative of a function along a direction, by forward mode.

    Each launch in the function is replaced by one that computes values and tangents together, so it
    costs about two evaluations, however many outputs there are. Inside of a tape's block the
    tangents are recorded too, for derivatives of them.

    Args:
        function: a Python function that launches kernels and returns an array or several.
        inputs: its arguments.
        tangents: an array like the input for each input, or None for zeros.

    Returns:
        The tangent of each returned array, as a list if the function returns a list or tuple.

    Example:
        >>> import warp as wp
        >>> x = wp.array([1.0, 2.0], dtype=float, device="cpu")
        >>> v = wp.array([1.0, 10.0], dtype=float, device="cpu")
        >>> print(wp.autograd.jvp(lambda x: x * x, inputs=[x], tangents=[v]))
        [ 2. 40.]

    Raises:
        WarpShapeError: a tangent does not fit its input.
        WarpCodegenError: a kernel cannot be differentiated.
    """
    state = Tangents(Watch.tape)
    _start(state, inputs, tangents, "tangents")
    with Watching(tape=None, executor=state):
        result = function(*inputs)
    several = isinstance(result, (list, tuple))
    results = list(result) if several else [result]
    for one in results:
        if not isinstance(one, array):
            raise TypeError(f"jvp: expects a function that returns arrays, but got {one!r}")
    found = [state.find(one) for one in results]
    made = [
        zeros_like(one, requires_grad=False) if tangent is None else clone(tangent)
        for one, tangent in zip(results, found, strict=True)
    ]
    return made if several else made[0]


def hvp(function: Callable, inputs: Sequence, vectors: Sequence) -> array | list[array]:
    """The Hessian of a function times a vector, by forward mode over reverse mode.

    Args:
        function: a Python function that launches kernels and returns an array of one element.
        inputs: its arguments; derivatives are taken by those with `requires_grad`. Gradients of
            arrays are left as they were.
        vectors: an array like the input for each input, or None for zeros.

    Returns:
        For each input the second derivative by it and along the vectors, None without
        `requires_grad`; the array itself if there is one input.

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
        WarpShapeError: a vector does not fit its input.
        WarpCodegenError: a kernel cannot be differentiated twice.
    """
    if not any(isinstance(one, array) and one.grad is not None for one in inputs):
        raise errors.WarpGradientError(
            "hvp: no input has a gradient", hint="make inputs with `requires_grad=True`"
        )
    state = Tangents()
    _start(state, inputs, vectors, "vectors")
    saved: list = []
    with Watching(tape=None, executor=state):
        with Tape(preserve="auto") as tape:
            loss = function(*inputs)
        if not isinstance(loss, array) or loss.size != 1:
            raise errors.WarpShapeError(
                f"hvp: expects a function that returns an array of one element, but got {loss!r}"
            )
        held = [*tape.arrays(), *(one for one in inputs if isinstance(one, array))]
        for grad in {id(one.grad): one.grad for one in held if one.grad is not None}.values():
            saved.append((grad, copy_layout(grad)))
            grad.zero_()
        tape.backward(loss=loss)
    result = [
        _packed(state.twin(one.grad)) if isinstance(one, array) and one.grad is not None else None
        for one in inputs
    ]
    for grad, contents in saved:
        grad.assign(contents)
    return result[0] if len(result) == 1 else result


def _packed(one: array) -> array:
    return clone(one, requires_grad=False)


def _start(state: Tangents, inputs, tangents, name) -> None:
    """Gives the inputs their tangents."""
    if len(inputs) != len(tangents):
        raise errors.WarpShapeError(
            f"expects as many {name} as inputs, but got {len(tangents)} for {len(inputs)}"
        )
    for one, tangent in zip(inputs, tangents, strict=True):
        if tangent is None:
            continue
        if not isinstance(one, array) or not isinstance(tangent, array):
            raise TypeError(f"expects arrays as {name}, but got '{type(tangent).__name__}'")
        if tangent.shape != one.shape:
            raise errors.WarpShapeError(
                f"expects {name} of shape {one.shape}, but got {tangent.shape}"
            )
        state.twin(one).assign(tangent)
