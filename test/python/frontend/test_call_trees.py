"""Trees of functions that call the one before twice: code does not double at each level."""

import time

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from warp.extend import errors


def tree(body, levels, kind="float", gradient=None):
    """A kernel that calls the last of functions of which each is `body` with the one before, and
    perhaps has a gradient of its own."""
    functions = [f"@wp.func\ndef f0(x: {kind}):\n    return x\n"]
    functions += [
        f"@wp.func\ndef f{level}(x: {kind}):\n    {body.format(f=f'f{level - 1}')}\n"
        for level in range(1, levels + 1)
    ]
    if gradient:
        for level in range(1, levels + 1):
            text = gradient.format(f=f"f{level - 1}")
            functions[level] += f"""
@wp.func_grad(f{level})
def adj_f{level}(x: {kind}, adj: {kind}):
    {text}
"""
    kernel = f"""
@wp.kernel
def kernel(x: wp.array(dtype={kind}), y: wp.array(dtype={kind})):
    i = wp.tid()
    y[i] = f{levels}(x[i])
"""
    return define("\n".join(functions) + kernel)["kernel"]


def test_what_copies_share_is_there_once():
    """f(x) = 2^n x + n 2^(n - 1), which is sums of 26 numbers in the end."""
    x = wp.array([0, 1, -3], dtype=int, device="cpu")
    y = wp.zeros(3, dtype=int, device="cpu")
    kernel = tree("return {f}(x) + {f}(x + 1)", 25, "int")
    began = time.monotonic()
    wp.launch(kernel, 3, [x, y], device="cpu")
    assert time.monotonic() - began < 30.0
    expected = [2**25 * one + 25 * 2**24 for one in (0, 1, -3)]
    assert y.numpy().tolist() == np.array(expected).astype(np.int32).tolist()


def test_derivatives():
    """f(x) = 3^40 x, of which a float has the power of two."""
    x = wp.array([1.0, 2.0], dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(tree("return {f}(x) + {f}(x) + {f}(x)", 40), 2, [x, y], device="cpu")
    np.testing.assert_allclose(y.numpy(), [3.0**40, 2 * 3.0**40], rtol=1e-5)
    tape.backward(grads={y: wp.ones(2, dtype=float, device="cpu")})
    np.testing.assert_allclose(x.grad.numpy(), [3.0**40] * 2, rtol=1e-5)


def test_gradients_of_their_own():
    """The gradient of f(x) = 2^n x is said to be f(x)."""
    x = wp.array([1.0, 3.0], dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    twice = "{f}(x) + {f}(x)"
    kernel = tree(f"return {twice}", 25, gradient=f"wp.adjoint[x] += adj * ({twice})")
    with wp.Tape() as tape:
        wp.launch(kernel, 2, [x, y], device="cpu")
    tape.backward(grads={y: wp.ones(2, dtype=float, device="cpu")})
    assert y.numpy().tolist() == [2.0**25, 3 * 2.0**25]
    assert x.grad.numpy().tolist() == [2.0**25, 3 * 2.0**25]


def test_small_trees_are_what_they_were():
    """Below the bound nothing of the code changes: 2^6 copies of a product."""
    x = wp.array([0.5, -1.5], dtype=float, device="cpu")
    y = wp.zeros(2, dtype=float, device="cpu")
    wp.launch(tree("return {f}(x * 0.5) - {f}(x * x)", 6), 2, [x, y], device="cpu")

    def plain(level, values):
        if level == 0:
            return values
        half, square = values * np.float32(0.5), values * values
        return plain(level - 1, half) - plain(level - 1, square)

    np.testing.assert_allclose(y.numpy(), plain(6, x.numpy()), rtol=1e-4)


def fold(values, level):
    """`f(x * 0.5) + f(x * x)`: all 2^level arguments of the innermost, then sums of pairs."""
    for _ in range(level):
        values = np.stack([values * np.float32(0.5), values * values], axis=-1)
    for _ in range(level):
        values = values[..., 0] + values[..., 1]
    return values


def follow(values, level):
    """The other function: a single way through its branches."""
    results = []
    for x in values:
        factor = np.float32(1.0)
        for _ in range(level):
            if x > 1.0:
                x = x * np.float32(0.5)
            else:
                x, factor = x + np.float32(1.0), factor * np.float32(2.0)
        results.append(x * factor)
    return np.array(results)


BRANCHES = "if x > 1.0:\n        return {f}(x * 0.5)\n    return {f}(x + 1.0) * 2.0"


@pytest.mark.parametrize(
    ("body", "levels", "expected"),
    [("return {f}(x * 0.5) + {f}(x * x)", 18, fold), (BRANCHES, 60, follow)],
)
def test_calls_stay(body, levels, expected):
    """Beyond the budget the largest functions stay functions, so that code follows the text."""
    x = wp.array([0.5, -0.75, 0.25], dtype=float, device="cpu")
    y = wp.zeros(3, dtype=float, device="cpu")
    kernel = tree(body, levels)
    wp.launch(kernel, 3, [x, y], device="cpu")
    np.testing.assert_allclose(y.numpy(), expected(x.numpy(), levels), rtol=1e-5)
    for text in (kernel.ir("llvm"), kernel.ir("ptx", arch=90)):
        assert len(text.splitlines()) < 40_000


def check_too_long(caught):
    message = str(caught.value)
    assert "operations or more once calls are written out, the most is 150000" in message
    assert "there would be 1073741824 copies of 'f0'" in message
    assert "<program" in message and "hint: loop over" in message
    assert "IR before" not in message


def test_too_long():
    """Functions that print are inlined: an error that names function, line, lengths and the way
    out, before the code is made."""
    x = wp.zeros(1, dtype=float, device="cpu")
    body = "print(x)\n    return {f}(x * 2.0) + {f}(x * x + 1.0)"
    with pytest.raises(errors.WarpError) as caught:
        wp.launch(tree(body, 30), 1, [x, x], device="cpu")
    check_too_long(caught)


@pytest.mark.parametrize("body", ["return {f}(x * 2.0) + {f}(x * x + 1.0)", BRANCHES])
def test_too_long_to_differentiate(body):
    """Derivatives of functions that do more than compute have all calls inlined, too."""
    body = f"print(x)\n    {body}"
    x = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(1, dtype=float, device="cpu", requires_grad=True)
    arguments = {"inputs": [x], "outputs": [y], "adj_inputs": [None], "adj_outputs": [None]}
    with pytest.raises(errors.WarpError) as caught:
        wp.launch(tree(body, 30), 1, adjoint=True, device="cpu", **arguments)
    check_too_long(caught)
