"""Errors about derivatives that users write: where, what was expected, what to do."""

import pytest

import warp as wp


@wp.func
def f(x: float, n: int):
    return x * float(n)


def message(problem):
    text = str(problem.value)
    assert __file__ in text.partition(".py:")[0] + ".py"
    return text


def test_parameters_must_begin_with_those_of_the_function():
    with pytest.raises(wp.WarpCodegenTypeError) as problem:

        @wp.func_grad(f)
        def f_grad(x: float, adj_ret: float):
            pass

    text = message(problem)
    assert "'f_grad' does not fit 'f'" in text
    assert "expects 'f_grad(x: float32, n: int32, cotangents of the results)'" in text
    assert "but got 'f_grad(x: float32, adj_ret: float32)'" in text


def test_parameters_must_end_with_cotangents_of_the_results():
    @wp.func
    def g(x: float):
        return x, x * 2.0

    @wp.func_grad(g)
    def g_grad(x: float, adj_ret: float):
        pass

    @wp.kernel
    def run(x: wp.array(dtype=float)):
        a, b = g(x[0])
        x[1] = a + b

    with pytest.raises(wp.WarpCodegenTypeError) as problem:
        run.ir()
    assert "expects 'g_grad(x: float32, adj_ret0: float32, adj_ret1: float32)'" in message(problem)


def test_replay_has_the_parameters_and_results_of_the_function():
    with pytest.raises(wp.WarpCodegenTypeError, match=r"'again' does not fit 'f': expects 'again"):

        @wp.func_replay(f)
        def again(x: float):
            return x

    @wp.func
    def g(x: float):
        return x

    @wp.func_replay(g)
    def replay(x: float):
        return 1

    @wp.kernel
    def run(x: wp.array(dtype=float)):
        x[0] = g(x[0])

    with pytest.raises(wp.WarpCodegenTypeError) as problem:
        run.ir()
    assert "expects results '(float32)', but got '(int32)'" in message(problem)


def test_adjoint_names_a_parameter_and_is_for_func_grad_only():
    @wp.func
    def g(x: float):
        return x

    @wp.func_grad(g)
    def g_grad(x: float, adj_ret: float):
        wp.adjoint[y] += adj_ret  # noqa: F821

    @wp.kernel
    def run(x: wp.array(dtype=float)):
        x[0] = g(x[0])

    with pytest.raises(wp.WarpCodegenKeyError, match="expects a parameter .*'g_grad'.* got 'y'"):
        run.ir()

    @wp.kernel
    def wrong(x: wp.array(dtype=float)):
        wp.adjoint[x][0] += 1.0

    with pytest.raises(wp.WarpCodegenError, match="in functions with `@wp.func_grad` only"):
        wrong.ir()
    with pytest.raises(TypeError, match="in functions with `@wp.func_grad` only"):
        wp.adjoint[1]


def test_func_grad_returns_nothing():
    @wp.func
    def g(x: float):
        return x

    @wp.func_grad(g)
    def g_grad(x: float, adj_ret: float):
        return adj_ret

    @wp.kernel
    def run(x: wp.array(dtype=float)):
        x[0] = g(x[0])

    with pytest.raises(wp.WarpCodegenError) as problem:
        run.ir()
    assert "which returns nothing" in message(problem) and "add to `wp.adjoint" in message(problem)


def test_custom_vjp_needs_fitting_functions():
    @wp.func
    def g(x: float):
        return x

    @wp.func
    def pullback(x: float, y: float, cotangent: float):
        return cotangent

    @wp.func
    def nothing(x: float, cotangent: float):
        return 1

    with pytest.raises(TypeError, match="expects functions with `@wp.func`, but got 'int'"):
        wp.custom_vjp(g, 3)
    unfit, wrong = wp.custom_vjp(g, pullback), wp.custom_vjp(g, nothing)

    @wp.kernel
    def run(x: wp.array(dtype=float)):
        x[0] = unfit(x[0])

    @wp.kernel
    def other(x: wp.array(dtype=float)):
        x[0] = wrong(x[0])

    with pytest.raises(wp.WarpCodegenTypeError, match=r"expects to take \(float32, float32\)"):
        run.ir()
    with pytest.raises(wp.WarpCodegenTypeError, match=r"'\(float32\)', but returns '\(\)'"):
        other.ir()


@pytest.mark.parametrize("make", [wp.grad, wp.hessian])
def test_derivatives_are_of_functions_and_called_in_kernels(make):
    with pytest.raises(TypeError, match="expects a function with `@wp.func` or a builtin"):
        make(3)
    with pytest.raises(TypeError, match="in kernels and functions of kernels only"):
        make(f)(1.0, 2)
    with pytest.raises(TypeError, match="in kernels and functions of kernels only"):
        wp.fixed_point(f, 1.0)


def test_hessian_is_by_a_scalar_or_vector_of_one_result():
    @wp.func
    def pair(x: float):
        return x, x

    @wp.func
    def trace(m: wp.mat22):
        return wp.trace(m)

    @wp.kernel
    def of_pair(x: wp.array(dtype=float)):
        x[0] = wp.hessian(pair)(x[0])

    @wp.kernel
    def of_matrix(x: wp.array(dtype=float)):
        h = wp.hessian(trace)(wp.mat22(x[0]))
        x[0] = h[0, 0]

    with pytest.raises(wp.WarpCodegenTypeError, match=r"expects one result of type 'float32'"):
        of_pair.ir()
    with pytest.raises(wp.WarpCodegenTypeError, match="a float or a vector of floats as first"):
        of_matrix.ir()


def test_fixed_point_starts_at_floats():
    @wp.func
    def step(n: int):
        return n

    @wp.kernel
    def run(x: wp.array(dtype=int)):
        x[0] = wp.fixed_point(step, x[0])

    said = "expects to start at floats, but got 'int32'"
    with pytest.raises(wp.WarpCodegenTypeError, match=said):
        run.ir()


def test_old_values_of_atomics_need_a_replay():
    @wp.func
    def count(x: float, n: wp.array(dtype=int)):
        return x * float(wp.atomic_add(n, 0, 1))

    @wp.func_grad(count)
    def count_grad(x: float, n: wp.array(dtype=int), adj_ret: float):
        wp.adjoint[x] += adj_ret

    @wp.kernel
    def run(x: wp.array(dtype=float), n: wp.array(dtype=int), out: wp.array(dtype=float)):
        out[0] = count(x[0], n)

    x, out = (wp.zeros(1, dtype=float, device="cpu", requires_grad=True) for _ in range(2))
    n = wp.zeros(1, dtype=int, device="cpu")
    with wp.Tape() as tape:
        wp.launch(run, 1, [x, n, out], device="cpu")
    with pytest.raises(wp.WarpError) as problem:
        tape.backward(out)
    text = message(problem)
    assert "the old value cannot be recovered when 'count' is differentiated" in text
    assert "`@wp.func_replay`" in text


def test_what_copies_of_a_line_report_is_said_once():
    @wp.kernel
    def normalise(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float), n: wp.array(dtype=int)):
        # A second run would not get the same numbers.
        i = wp.tid()
        for j in range(x.shape[1]):
            y[i, j] = x[i, j] * x[i, j]
            n[1] = wp.atomic_add(n, 0, 1)
        high = y[i, 0]
        for j in range(x.shape[1]):
            high = wp.max(high, y[i, j])
        total = float(0.0)
        for j in range(x.shape[1]):
            total += wp.exp(y[i, j] - high)
        for j in range(x.shape[1]):
            y[i, j] = y[i, j] - high - wp.log(total)

    with pytest.raises(RuntimeError, match="overwrites it") as problem:
        normalise.ir(derivative="adjoint")
    assert str(problem.value).count("overwrites it") == 1
