"""Checks that print: `expect_eq`, `expect_neq`, `expect_near`."""

import math

import pytest

import warp as wp

VEC = (wp.vec3(1.0, 2.0, 3.0), wp.vec3(1.0, 2.0, 4.5))
MAT = (wp.mat22(1.0, 2.0, 3.0, 5.0), wp.mat22(1.0, 2.0, 4.0, 5.0))
QUAT = (wp.quat(1.0, 2.0, 3.0, 5.0), wp.quat(1.0, 2.0, 4.0, 5.0))
EQ = "Error, expect_eq() failed:\n\t Expected: {}\n\t Actual: {}\n"
NEQ = "Error, expect_neq() failed:\n\t Expected: {}\n\t Actual: {}\n"


def printed(capfd, body, device="cpu"):
    """The output of a kernel of one thread."""
    capfd.readouterr()
    wp.launch(wp.Kernel(body), 1, device=device)
    wp.synchronize()
    return capfd.readouterr().out


@pytest.mark.parametrize(
    ("actual", "expected", "text"),
    [
        (1, 2, ("2", "1")),
        (1.5, 2.25, ("2.25", "1.5")),
        (True, False, ("False", "True")),
        (False, True, ("True", "False")),
        (wp.int8(1), wp.int8(-2), ("-2", "1")),
        (wp.uint64(2**63), wp.uint64(3), ("3", str(2**63))),
        (wp.int64(-(2**40)), wp.int64(3), ("3", str(-(2**40)))),
        (wp.float64(0.1), wp.float64(2.0), ("2", "0.1")),
        (*VEC, ("1 2 4.5 ", "1 2 3 ")),
        (*MAT, ("1 2 \n4 5 ", "1 2 \n3 5 ")),
        (*QUAT, ("1 2 4 5", "1 2 3 5")),
        (
            wp.transform(VEC[0], QUAT[0]),
            wp.transform(VEC[1], QUAT[1]),
            ("(1 2 4.5) (1 2 4 5)", "(1 2 3) (1 2 3 5)"),
        ),
    ],
)
def test_expect_eq_prints_what_differs(capfd, device, actual, expected, text):
    def differ():
        wp.expect_eq(actual, expected)
        wp.expect_neq(actual, expected)

    def agree():
        wp.expect_eq(actual, actual)

    def same():
        wp.expect_neq(actual, actual)

    assert printed(capfd, differ, device) == EQ.format(*text)
    assert printed(capfd, agree, device) == ""
    assert printed(capfd, same, device) == NEQ.format(text[1], text[1])


def test_expect_near(capfd, device):
    def far():
        wp.expect_near(VEC[0], VEC[1], 0.25)
        wp.expect_near(wp.float64(1.0), wp.float64(1.5))

    def near():
        wp.expect_near(VEC[0], VEC[1], 1.5)
        wp.expect_near(MAT[0], MAT[1], tolerance=1.0)
        wp.expect_near(1.0, 1.0 + 4.8e-7)
        wp.expect_near(wp.inf, wp.inf)

    def undefined():
        wp.expect_near(wp.nan, 1.0, 1.0e9)

    assert printed(capfd, far, device) == (
        "Error, expect_near() failed with tolerance 0.25\n"
        "    Expected: 1 2 4.5 \n    Actual: 1 2 3 \n    Max absolute difference: 1.5\n"
        "Error, expect_near() failed with tolerance 1e-06\n"
        "    Expected: 1.5\n    Actual: 1\n    Absolute difference: 0.5\n"
    )
    assert printed(capfd, near, device) == ""
    assert "Expected: 1\n    Actual: nan\n" in printed(capfd, undefined, device)


def test_checks_of_values_of_a_launch(capfd, device):
    @wp.struct
    class Pair:
        a: wp.vec2
        b: wp.uint8

    def check(pair: Pair, x: wp.array(dtype=float)):
        i = wp.tid()
        wp.expect_eq(pair.a, wp.vec2(1.0, 2.0))
        wp.expect_eq(pair.b, wp.uint8(7))
        wp.expect_eq(x[i], 3.0)
        wp.expect_eq(x[i], 3)

    pair = Pair()
    pair.a, pair.b = wp.vec2(1.0, 2.0), 7
    kernel = wp.Kernel(check)
    wp.launch(kernel, 2, [pair, wp.array([3.0, 3.0], dtype=float, device=device)], device=device)
    wp.synchronize()
    assert capfd.readouterr().out == ""
    wp.launch(kernel, 2, [pair, wp.array([3.0, 4.0], dtype=float, device=device)], device=device)
    wp.synchronize()
    assert capfd.readouterr().out == EQ.format("3", "4") * 2


def test_values_of_different_types_are_an_error():
    def mixed(a: wp.vec3, b: wp.vec2):
        wp.expect_eq(a, b)

    def whole(a: int):
        wp.expect_near(a, 1)

    for body, fragment in ((mixed, "of one type to compare"), (whole, "expects floats")):
        with pytest.raises(wp.WarpCodegenTypeError, match=fragment):
            wp.Kernel(body).prepare()


def test_large_matrices_print_whole(capfd):
    matrix = wp.spatial_matrix(*range(36))

    def shown():
        print(matrix)

    rows = [" ".join(str(6 * row + column) for column in range(6)) for row in range(6)]
    assert printed(capfd, shown) == "\n".join(rows) + "\n"


def test_checks_in_python(capfd):
    wp.expect_eq(1, 1)
    wp.expect_eq(*VEC)
    wp.expect_neq(wp.int32(2), 2)
    wp.expect_near(1.0, 1.5)
    wp.expect_near(math.inf, math.inf)
    assert capfd.readouterr().out == (
        EQ.format("1 2 4.5 ", "1 2 3 ")
        + NEQ.format("2", "2")
        + "Error, expect_near() failed with tolerance 1e-06\n"
        "    Expected: 1.5\n    Actual: 1\n    Absolute difference: 0.5\n"
    )
    with pytest.raises(TypeError, match="one type to compare"):
        wp.expect_eq(wp.vec2(), wp.vec3())
    assert wp.static(3) == 3
