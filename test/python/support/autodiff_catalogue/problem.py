"""The environment of a case: a precision, a device, arrays, gradients and comparisons.

A case builds kernels from `real`, `vec3`, ... and asks `pullback` for the gradients of a launch.
Expected values are computed by the case, in float64 or exactly. Nothing here is specific to one
package but `metrics`, `dot_test` and `singular`, which the peer has no counterpart of.
"""

import contextlib
import io
import os
import sys
import tempfile

import numpy as np

import warp as wp

with contextlib.suppress(ImportError):
    import warp.autograd

from .registry import Mismatch, located

# A module, that is a compilation, of its own per kernel under NVIDIA Warp.
kernel = wp.kernel(module="unique")
IS_PEER = not hasattr(wp, "_src") or not hasattr(wp.Kernel, "ir")
NUMPY = {"float16": np.float16, "float32": np.float32, "float64": np.float64}


def kernel_of(function):
    """Like `kernel`, for a body that calls `function`, a name of the enclosing scope.

    The peer tells kernels apart by their text, in which functions of the language that have
    been handed in do not appear; the name then tells them apart.
    """

    def define(body):
        name = getattr(function, "key", None) or getattr(function, "__name__", "")
        body.__qualname__ += "_" + name.rpartition(".")[2]
        return kernel(body)

    return define


class Problem:
    """One run of a case.

    Attributes:
        real: the scalar type; `vec2`, `vec3`, `mat33`, `quat` follow it.
        eps: its machine epsilon.
        device: where arrays lie and kernels run.
        dot: whether `pullback` also compares with forward mode.
        condition: by what a case multiplies the rounding error allowed in that comparison.
    """

    def __init__(self, precision, device, dot=False):
        self.precision, self.device, self.dot = precision, device, dot
        self.real = getattr(wp, precision)
        self.eps = float(np.finfo(NUMPY[precision]).eps)
        self.vec2 = wp.types.vector(2, self.real)
        self.vec3 = wp.types.vector(3, self.real)
        self.vec4 = wp.types.vector(4, self.real)
        self.mat33 = wp.types.matrix((3, 3), self.real)
        self.quat = {"float32": wp.quatf, "float64": wp.quatd}.get(precision)
        self.rng = np.random.default_rng(1)
        self.dot_tests, self.dot_failures, self.condition = 0, [], 1.0

    def at(self, precision):
        """The same problem in another precision."""
        return Problem(precision, self.device, self.dot)

    # Arrays.

    def random(self, *shape, low=0.5, high=1.5):
        """Float64 numbers that are exact in every precision but float16."""
        return self.rng.uniform(low, high, shape).astype(np.float32).astype(np.float64)

    def array(self, data, dtype=None, grad=True):
        """An array of the case's scalar type, or of `dtype`, on the device."""
        dtype = dtype or self.real
        return wp.array(np.asarray(data), dtype=dtype, device=self.device, requires_grad=grad)

    def ints(self, data):
        """An array of 32-bit integers; it has no gradient."""
        return wp.array(np.asarray(data, np.int32), dtype=wp.int32, device=self.device)

    def zeros(self, shape, dtype=None):
        """Zeros with a gradient."""
        dtype = dtype or self.real
        return wp.zeros(shape, dtype=dtype, device=self.device, requires_grad=True)

    def launch(self, kernel, dim, inputs=(), outputs=()):
        wp.launch(kernel, dim=dim, inputs=list(inputs), outputs=list(outputs), device=self.device)

    # Gradients.

    def seed(self, output, weights=1.0):
        """Cotangents of an output array: `weights` in its shape."""
        like = output.numpy()
        wide = np.float32 if like.dtype == np.float16 else like.dtype
        data = np.broadcast_to(np.asarray(weights, wide), like.shape).copy()
        dtype = wp.float32 if output.dtype == wp.float16 else output.dtype
        if output.ndim and output.dtype == wp.float16 and output.grad is not None:
            dtype = output.grad.dtype
        return wp.array(data, dtype=dtype, device=self.device)

    def pullback(self, kernel, dim, inputs, outputs, weights=None):
        """Gradients of Σ weights · outputs per differentiable input, in float64.

        Args:
            kernel: a kernel of `inputs` and `outputs` in this order.
            dim: of the launch.
            inputs: arguments; arrays with gradients are differentiated.
            outputs: arrays.
            weights: one per output; ones by default.
        """
        weights = [1.0] * len(outputs) if weights is None else weights
        if self.dot and any(map(has_gradient, inputs)):
            try:
                self.dot_test(kernel, dim, inputs, outputs)
            except Exception as problem:
                self.dot_failures.append(str(problem) or repr(problem))
        with wp.Tape() as tape:
            self.launch(kernel, dim, inputs, outputs)
        tape.backward(grads={out: self.seed(out, w) for out, w in zip(outputs, weights)})
        return [gradient(item) for item in inputs if has_gradient(item)]

    def value(self, kernel, dim, inputs, outputs):
        """The first output in float64."""
        self.launch(kernel, dim, inputs, outputs)
        return np.array(outputs[0].numpy(), np.float64)

    def dot_test(self, kernel, dim, inputs, outputs):
        """⟨Jv, w⟩ = ⟨v, Jᵀw⟩ for random v and w, within 32 u of the norms; or both are infinite."""
        fresh = [wp.clone(item) if has_gradient(item) else item for item in inputs]
        active = [item for item in fresh if has_gradient(item)]

        def function(*arrays):
            given = iter(arrays)
            arguments = [next(given) if has_gradient(item) else item for item in fresh]
            made = [wp.clone(output) for output in outputs]
            self.launch(kernel, dim, arguments, made)
            return made

        rng = np.random.default_rng(2)
        draw = [rng.normal(size=item.numpy().shape) for item in active]
        tangents = [self.seed(item, v) for item, v in zip(active, draw)]
        pushed = [item.numpy() for item in wp.autograd.jvp(function, active, tangents)]
        weights = [rng.normal(size=item.shape) for item in pushed]
        with wp.Tape() as tape:
            made = function(*active)
        tape.backward(grads={out: self.seed(out, w) for out, w in zip(made, weights)})
        pulled = [gradient(item) for item in active]
        left, left_size = dot(pushed, weights)
        right, right_size = dot(draw, pulled)
        bound = 16 * self.eps * self.condition * max(left_size, right_size)
        alike = left == right or (np.isnan(left) and np.isnan(right))
        if not alike and not abs(left - right) <= bound:
            raise Mismatch(f"⟨Jv, w⟩ = {left!r}, ⟨v, Jᵀw⟩ = {right!r}, allowed {bound:.3g}")
        self.dot_tests += 1

    def finite_differences(self, build, single=2e-3):
        """Compares the gradient of a launch with fourth-order central differences.

        In float32 it is compared with the gradient in float64, which a run of its own compares
        with differences.

        Args:
            build: from a `Problem` to (kernel, dim, inputs, outputs).
            single: the relative error allowed in float32.
        """
        parts = build(self)
        weights = [self.rng.normal(size=out.numpy().shape) for out in parts[3]]
        got = np.concatenate([g.ravel() for g in self.pullback(*parts, weights)])
        if self.precision == "float64":
            expected, size = differences(self, build(self), weights)
            self.near(got, expected, 1e-6, floor=1e-4 * size)
        else:
            other = self.at("float64")
            wide = other.pullback(*build(other), weights)
            self.near(got, np.concatenate([g.ravel() for g in wide]), single)

    # Comparisons.

    def close(self, got, expected, ulps=16):
        """Largest difference within `ulps` machine epsilons of the largest expected value."""
        self.near(got, expected, ulps * self.eps)

    def near(self, got, expected, relative, floor=0.0):
        """Largest difference within `relative` of the largest expected value, or of `floor`."""
        got, expected = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (got, expected)))
        error = np.abs(got - expected).max(initial=0.0)
        bound = relative * np.abs(expected).max(initial=floor)
        if not error <= bound:
            text = f"got {show(got)}, expected {show(expected)}"
            raise Mismatch(f"{text}: error {error:.3g}, allowed {bound:.3g}")

    def same(self, got, expected):
        """Exact equality; NaN equals NaN."""
        if not np.array_equal(np.asarray(got), np.asarray(expected), equal_nan=True):
            raise Mismatch(f"got {show(np.asarray(got))}, expected {show(np.asarray(expected))}")

    def holds(self, condition, text):
        if not condition:
            raise Mismatch(text)

    # Messages and metrics.

    def refuses(self, action, *words, lines=1):
        """`action` must raise an error that has the words and names source lines."""
        try:
            action()
        except Mismatch:
            raise
        except Exception as problem:
            message = str(problem)
        else:
            raise Mismatch("no error is raised")
        missing = [word for word in words if word.lower() not in message.lower()]
        if missing:
            raise Mismatch(f"the message lacks {missing}: {message}")
        if lines and not located(message, lines):
            raise Mismatch(f"the message names fewer than {lines} source lines: {message}")

    def metrics(self, kernel, **expected):
        """Compares counts of an adjoint kernel; values may be predicates."""
        if IS_PEER:
            return
        found = wp.autograd.adjoint_metrics(kernel)
        for name, want in expected.items():
            right = want(found[name]) if callable(want) else found[name] == want
            if not right:
                raise Mismatch(f"adjoint metric '{name}' is {found[name]}")


@contextlib.contextmanager
def setting(**values):
    """Settings of `wp.config` inside the block."""
    before = {name: getattr(wp.config, name) for name in values}
    try:
        for name, value in values.items():
            setattr(wp.config, name, value)
        yield
    finally:
        for name, value in before.items():
            setattr(wp.config, name, value)


def deterministic():
    """The setting under which sums have the same bits in every run."""
    modes = getattr(wp, "DeterministicMode", None) or getattr(wp.config, "DeterministicMode", None)
    return setting(deterministic=modes.RUN_TO_RUN if modes else True)


@contextlib.contextmanager
def printed(lines):
    """Appends to `lines` what is printed inside, by Python or below it."""
    sys.stdout.flush()
    sys.stderr.flush()
    text = io.StringIO()
    with tempfile.TemporaryFile("w+") as below:
        saved = [os.dup(number) for number in (1, 2)]
        for number in (1, 2):
            os.dup2(below.fileno(), number)
        try:
            with contextlib.redirect_stdout(text), contextlib.redirect_stderr(text):
                yield
        finally:
            for number, old in zip((1, 2), saved):
                os.dup2(old, number)
                os.close(old)
        below.seek(0)
        lines += (text.getvalue() + below.read()).splitlines()


def only(result):
    """The one array of a result that may be a list."""
    if isinstance(result, list | tuple):
        (result,) = result
    return result


def has_gradient(item):
    """True if an argument is an array with a gradient."""
    return getattr(item, "requires_grad", False) and getattr(item, "grad", None) is not None


def gradient(item):
    """The gradient of an array in float64."""
    return np.array(item.grad.numpy(), np.float64)


def dot(left, right):
    """Σ a·b over lists of arrays, and the product of their norms."""
    left, right = (
        np.concatenate([np.ravel(a).astype(np.float64) for a in s]) for s in (left, right)
    )
    return float(left @ right), norm(left) * norm(right)


def norm(values):
    """Euclidean norm without overflow."""
    largest = float(np.abs(values).max(initial=0.0))
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    return largest * float(np.linalg.norm(values / largest))


def differences(problem, parts, weights, step=1e-3):
    """Fourth-order central differences of Σ weights · outputs, by every input element.

    Returns:
        The differences, and the size of the terms of the sum.
    """
    kernel, dim, inputs, outputs = parts
    starts = [out.numpy().copy() for out in outputs]

    def loss():
        for out, start in zip(outputs, starts):
            out.assign(start)
        problem.launch(kernel, dim, inputs, outputs)
        return sum(float((w * out.numpy()).sum()) for w, out in zip(weights, outputs))

    loss()
    size_of_terms = sum(float(np.abs(w * out.numpy()).sum()) for w, out in zip(weights, outputs))
    result = []
    for item in filter(has_gradient, inputs):
        data = item.numpy().copy()
        flat = data.reshape(-1).copy()
        for index, value in enumerate(flat):
            size = step * max(1.0, abs(value))
            total = 0.0
            for shift, factor in ((-2, 1), (-1, -8), (1, 8), (2, -1)):
                moved = flat.copy()
                moved[index] = value + shift * size
                item.assign(moved.reshape(data.shape))
                total += factor * loss()
            result.append(total / (12.0 * size))
        item.assign(data)
    return np.array(result), size_of_terms


def show(values):
    """A few numbers as text."""
    with np.printoptions(precision=9, threshold=12, edgeitems=4):
        return " ".join(str(values).split())
