"""Random programs: gradients are those of dual numbers in Python, forward and backward."""

import numpy as np
from hypothesis import given

import warp as wp
from autodiff_catalogue.problem import only
from autodiff_programs import DATA, Dual, Functions, inputs_of, programs
from frontend_programs import define
from random_runs import examples

KERNEL = """
@wp.kernel
def kernel(x: wp.array(dtype=R), y: wp.array(dtype=R), d: D, n: int, out: wp.array(dtype=R)):
    i = wp.tid()
    out[i] = program(x[i], y[i], d, n)
"""
REAL = wp.float64
X, Y = np.array([0.3, -0.7, 1.1]), np.array([0.9, 0.4, -0.6])
D = np.array([0.25, -0.5, 0.75, 1.25])


def expected(program, n):
    """Gradients by x and y per thread, and by the shared array, of the sum of the results."""
    rows = []
    for x, y in zip(X, Y):
        a, b, data = inputs_of(x, y, D)
        rows.append(program(a, b, data, n).slope + np.zeros(2 + DATA))
    rows = np.array(rows)
    return [rows[:, 0], rows[:, 1], rows[:, 2:].sum(axis=0)]


def close(got, wanted, source):
    np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-11, err_msg=source)


def check(kernel, n, wanted, source):
    """Backward against the expected gradients, forward mode against their products."""
    arrays = [wp.array(v, dtype=REAL, device="cpu", requires_grad=True) for v in (X, Y, D)]

    def function(x, y, d):
        out = wp.zeros(len(X), dtype=REAL, device="cpu", requires_grad=True)
        wp.launch(kernel, len(X), [x, y, d, n, out], device="cpu")
        return out

    with wp.Tape() as tape:
        out = function(*arrays)
    tape.backward(grads={out: wp.ones(len(X), dtype=REAL, device="cpu")})
    for item, want in zip(arrays, wanted):
        close(item.grad.numpy(), want, source)
    tangents = [np.cos(np.arange(len(v))) for v in (X, Y, D)]
    given = [wp.array(v, dtype=REAL, device="cpu") for v in tangents]
    pushed = only(wp.autograd.jvp(function, arrays, given))
    right = sum(float(v @ gradient) for v, gradient in zip(tangents, wanted))
    close(pushed.numpy().sum(), right, source)


@examples(50)
@given(programs())
def test_gradients_of_random_programs(source):
    plain = define(source, wp=Functions, R=Dual, D=list)["program"]
    space = define("@wp.func\n" + source + KERNEL, R=REAL, D=wp.array(dtype=REAL))
    for n in (0, 2, DATA):
        check(space["kernel"], n, expected(plain, n), source)
