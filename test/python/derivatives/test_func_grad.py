"""Functions with derivatives of their own: `func_grad` and `func_replay`."""

import numpy as np
import pytest

import warp as wp
from derivative_programs import gradients, result, variable


@wp.struct
class Pair:
    scale: float
    v: wp.vec3
    count: int


@wp.func
def several(x: float, y: float):
    return x * 3.0 + y / 3.0, y**2.5


@wp.func_grad(several)
def several_grad(x: float, y: float, adj_ret0: float, adj_ret1: float):
    if x > 0.0:
        wp.adjoint[x] += x * adj_ret0 * 42.0 + y * adj_ret1 * 10.0
    for _ in range(3):
        wp.adjoint[y] += y * adj_ret1


@wp.func
def several(p: Pair):  # noqa: F811  (an overload)
    return p.scale * wp.length(p.v)


@wp.func_grad(several)
def several_grad(p: Pair, adj_ret: float):  # noqa: F811
    wp.adjoint[p.scale] += 2.0 * adj_ret
    wp.adjoint[p.v][0] += 3.0 * adj_ret
    wp.adjoint[p].v.z += 4.0 * adj_ret


@wp.func
def fill(i: int, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    y[i] = wp.sin(x[i])


@wp.func_grad(fill)
def fill_grad(i: int, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.adjoint[x][i] += 7.0 * wp.adjoint[y][i]


@wp.func
def next_index(counter: wp.array(dtype=int), kept: wp.array(dtype=int), i: int):
    kept[i] = wp.atomic_add(counter, 0, 1)
    return kept[i]


@wp.func_replay(next_index)
def kept_index(counter: wp.array(dtype=int), kept: wp.array(dtype=int), i: int):
    return kept[i]


def test_func_grad_in_branches_and_loops_of_several_results(device):
    @wp.kernel
    def run(x: wp.array(dtype=float), y: wp.array(dtype=float), a: wp.array(dtype=float),
            b: wp.array(dtype=float)):  # fmt: skip
        i = wp.tid()
        p, q = several(x[i], y[i])
        a[i] = p
        b[i] = q

    x, y = variable([1.0, -2.0], device), variable([10.0, 11.0], device)
    gradients(run, 2, [x, y], [result(2, device), result(2, device)], device=device)
    assert x.grad.numpy().tolist() == [142.0, 0.0]
    assert y.grad.numpy().tolist() == [30.0, 33.0]


def test_func_grad_of_a_struct_chooses_the_overload(device):
    @wp.kernel
    def run(p: wp.array(dtype=Pair), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = several(p[i])

    pair = Pair()
    pair.scale, pair.v = 2.0, wp.vec3(3.0, 0.0, 4.0)
    p, out = variable([pair], device, Pair), result(1, device)
    gradients(run, 1, [p], [out], device=device)
    assert out.numpy()[0] == 10.0
    scale, v, _ = p.grad.numpy()[0]
    assert scale == 2.0 and v.tolist() == [3.0, 0.0, 4.0]


@wp.kernel
def run_fill(x: wp.array(dtype=float), y: wp.array(dtype=float), a: wp.array(dtype=float),
             b: wp.array(dtype=float)):  # fmt: skip
    i = wp.tid()
    fill(i, x, y)
    b[i] = 2.0 * a[i]


@pytest.mark.parametrize("active", ["x y", "x", "y", ""])
def test_func_grad_of_arrays_of_which_some_have_gradients(device, active):
    x = wp.array([1.0, 2.0], dtype=float, device=device, requires_grad="x" in active)
    y = wp.zeros(2, dtype=float, device=device, requires_grad="y" in active)
    a, b = variable([1.0, 2.0], device), result(2, device)
    outputs = [y, a, b] if y.requires_grad else [b]
    with wp.Tape() as tape:
        wp.launch(run_fill, 2, [x, y, a, b], device=device)
    tape.backward(grads={o: wp.ones(2, dtype=float, device=device) for o in outputs})
    assert (a.grad.numpy() >= 2.0).all()
    if active == "x y":
        assert x.grad.numpy().tolist() == [7.0, 7.0]


def test_func_grad_of_rows(device):
    """The gradient of a view is the view of the gradient."""

    @wp.kernel
    def run(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
        i, j = wp.tid()
        fill(j, x[i], y[i])

    x = variable(np.arange(6).reshape(2, 3), device)
    gradients(run, (2, 3), [x], [result((2, 3), device)], device=device)
    assert (x.grad.numpy() == 7.0).all()


def test_func_grad_nested_two_deep(device):
    """T104: the derivative belongs to the function wherever it is called.

    The result gets its gradient with the seed.
    """

    @wp.func
    def inner(x: float):
        return x * x

    @wp.func_grad(inner)
    def inner_grad(x: float, adj_ret: float):
        wp.adjoint[x] += 100.0 * adj_ret * inner(x)

    @wp.func
    def outer(x: float):
        return 3.0 * inner(x)

    @wp.kernel
    def run(x: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = outer(x[i]) + 1.0

    x, out = variable([2.0], device), wp.zeros(1, dtype=float, device=device)
    gradients(run, 1, [x], [out], device=device)
    assert out.numpy()[0] == 13.0 and x.grad.numpy()[0] == 1200.0


def test_func_replay_of_a_counter(device):
    @wp.kernel
    def run(x: wp.array(dtype=float), counter: wp.array(dtype=int), kept: wp.array(dtype=int),
            out: wp.array(dtype=float)):  # fmt: skip
        i = wp.tid()
        j = next_index(counter, kept, i)
        out[j] = x[i] ** 2.0

    n = 128
    x, out = variable(np.arange(n), device), result(n, device)
    counter, kept = (wp.zeros(size, dtype=int, device=device) for size in (1, n))
    gradients(run, n, [x, counter, kept], [out], device=device)
    np.testing.assert_allclose(x.grad.numpy(), 2.0 * np.arange(n))
    assert counter.numpy()[0] == n


def test_primal_code_does_not_depend_on_derivatives():
    def make(custom):
        @wp.func
        def f(x: float):
            return wp.sin(x)

        if custom:

            @wp.func_grad(f)
            def f_grad(x: float, adj_ret: float):
                wp.adjoint[x] += adj_ret

        @wp.kernel
        def run(x: wp.array(dtype=float), out: wp.array(dtype=float)):
            i = wp.tid()
            out[i] = f(x[i])

        return run

    assert make(True).ir("llvm") == make(False).ir("llvm")


def test_grad_of_a_function_with_its_own_derivative_and_structs(device):
    @wp.kernel
    def run(p: Pair, out: wp.array(dtype=float)):
        d = wp.grad(several)(p)
        out[0] = d.scale
        out[1] = d.v[0]
        out[2] = float(d.count)

    pair = Pair()
    pair.scale, pair.v, pair.count = 2.0, wp.vec3(1.0, 1.0, 1.0), 5
    out = wp.zeros(3, dtype=float, device=device)
    wp.launch(run, 1, [pair, out], device=device)
    assert out.numpy().tolist() == [2.0, 3.0, 0.0]


def test_effects_happen_once(device):
    """The backward pass has results again without writing anything."""

    @wp.func
    def log(x: float, total: wp.array(dtype=float)):
        wp.atomic_add(total, 0, x)
        return x * x

    @wp.func_grad(log)
    def log_grad(x: float, total: wp.array(dtype=float), adj_ret: float):
        wp.adjoint[x] += 5.0 * adj_ret

    @wp.kernel
    def run(x: wp.array(dtype=float), total: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        y = log(x[i], total)
        out[i] = y * y

    x, total = variable([1.0, 2.0], device), wp.zeros(1, dtype=float, device=device)
    gradients(run, 2, [x, total], [result(2, device)], device=device)
    assert total.numpy()[0] == 3.0
    assert x.grad.numpy().tolist() == [10.0, 40.0]
