"""`wp.static` is evaluated where a kernel is declared, if it uses no variable of the kernel."""

# ruff: noqa: B023

import pytest

import warp as wp

device = "cpu"
_number = 0


@wp.func
def identity(x: float):
    return x


@wp.func
def negate(x: float):
    return -x


def run(kernel, dtype=int):
    out = wp.zeros(1, dtype=dtype, device=device)
    wp.launch(kernel, 1, inputs=[out], device=device)
    return out.numpy()[0]


def test_kernels_declared_in_a_loop_have_its_values():
    global _number
    kernels = []
    for _number in range(3):

        @wp.kernel(module="unique")
        def declared(out: wp.array(dtype=int)):
            out[0] = wp.static(_number)

        kernels.append(declared)
    assert [run(kernel) for kernel in kernels] == [0, 1, 2]


def test_captured_variables_that_change():
    kernels = []
    for n in range(3):

        @wp.func
        def plus(x: int):
            return x + wp.static(n * 10)

        @wp.kernel
        def declared(out: wp.array(dtype=int)):
            out[0] = plus(wp.static(n))

        kernels.append((declared, plus))
    # The functions are captured by name: all kernels call the last one.
    assert [run(kernel) for kernel, _ in kernels] == [20, 21, 22]


def test_functions_as_values():
    kernels = []
    for function in (identity, negate):

        @wp.kernel
        def declared(out: wp.array(dtype=float)):
            out[0] = wp.static(function)(3.0)

        kernels.append(declared)
    assert [run(kernel, float) for kernel in kernels] == [3.0, -3.0]


def test_evaluated_once():
    counted = []

    def count():
        counted.append(1)
        return len(counted)

    @wp.kernel(module="unique")
    def declared(out: wp.array(dtype=int)):
        out[0] = wp.static(count()) + 10 * wp.static(count())

    assert len(counted) == 2
    assert run(declared) == 21
    assert len(counted) == 2


def test_several_lines_comments_and_strings():
    values = {"a)": 4, "b": 5}

    @wp.kernel
    def declared(out: wp.array(dtype=int)):
        """Text of `wp.static(1 / 0)`."""
        # wp.static(1 / 0)
        é = 1
        out[0] = é + wp.static(
            values["a)"]  # )
            + max(
                values.values(),
            )
        )

    values["b"] = 7
    assert run(declared) == 10


def test_own_variables_wait_for_the_translation():
    n = 100

    @wp.kernel
    def declared(out: wp.array(dtype=int)):
        total = int(0)
        for n in range(3):
            total += wp.static(n + 1)
        out[0] = total + wp.static(sum(k for k in range(3)))

    assert n == 100
    assert run(declared) == 9


def test_what_is_not_there_yet():
    @wp.kernel
    def declared(out: wp.array(dtype=int)):
        out[0] = wp.static(later)

    with pytest.raises(wp.WarpCodegenError, match="static expression failed"):
        run(declared)
    later = 5
    declared.module.mark_modified()
    assert run(declared) == 5


def test_keyword():
    @wp.kernel
    def declared(out: wp.array(dtype=int)):
        out[0] = wp.static(expr=2 + 3)

    assert run(declared) == 5


def test_an_expression_in_another_is_evaluated_once():
    """Python evaluates the inner `wp.static` with the outer one, and by itself where that fails."""
    counted = []

    def one_more():
        counted.append(1)
        return 3

    @wp.kernel(module="unique")
    def nested(out: wp.array(dtype=int)):
        out[0] = wp.static(1 + wp.static(one_more()) + wp.static(one_more()))

    assert len(counted) == 2
    assert run(nested) == 7
    assert len(counted) == 2

    @wp.kernel(module="unique")
    def beside(out: wp.array(dtype=int)):
        for i in range(2):
            out[0] = wp.static(i + wp.static(one_more())) + wp.static(one_more())

    assert run(beside) == 7
