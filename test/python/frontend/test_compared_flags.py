"""Booleans compare with numbers as the numbers 0 and 1, as in Python."""

import operator
from typing import Any

import numpy as np
import pytest

import warp as wp
from frontend_programs import define, run

OPERATORS = {
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
NUMBERS = {
    "0": 0,
    "1": 1,
    "2": 2,
    "-1": -1,
    "0.5": 0.5,
    "1.0": 1.0,
    "n": 1,
    "True": True,
    "flags[0]": False,
    "wp.uint8(255)": 255,
    "wp.int64(1)": 1,
    "wp.float64(0.0)": 0.0,
    "wp.float16(1.0)": 1.0,
    "SMALL": 1,
    "float(wp.nan)": float("nan"),
}


@pytest.mark.parametrize("flag", ["flags[i]", "local", "held.flag", "TRUTH", "vector[i]"])
@pytest.mark.parametrize("compare", OPERATORS)
def test_comparisons(flag, compare):
    lines = [
        line
        for k, text in enumerate(NUMBERS)
        for line in (
            f"    if {flag} {compare} {text}:",
            f"        out[i, {2 * k}] = 1",
            f"    if {text} {compare} {flag}:",
            f"        out[i, {2 * k + 1}] = 1",
        )
    ]
    source = f"""
@wp.struct
class Held:
    flag: wp.bool

@wp.kernel
def kernel(flags: wp.array(dtype=wp.bool), n: int, out: wp.array2d(dtype=int)):
    i = wp.tid()
    local = flags[i]
    held = Held()
    held.flag = local
    vector = wp.vector(flags[0], flags[1], dtype=wp.bool)
{chr(10).join(lines)}
"""
    kernel = define(source, TRUTH=True, SMALL=wp.constant(wp.uint16(1)))["kernel"]
    out = wp.zeros((2, 2 * len(NUMBERS)), dtype=int, device="cpu")
    flags = wp.array([False, True], dtype=wp.bool, device="cpu")
    wp.launch(kernel, 2, [flags, 1, out], device="cpu")
    for i, value in enumerate((flag == "TRUTH", True)):
        expected = [
            OPERATORS[compare](*pair)
            for number in NUMBERS.values()
            for pair in ((value, number), (number, value))
        ]
        assert out.numpy()[i].tolist() == expected


@wp.func
def is_zero(x: Any):
    return x == 0


@wp.kernel
def conditions(mask: wp.array(dtype=wp.bool), out: wp.array(dtype=int)):
    i = wp.tid()
    more = mask[i]
    count = int(0)
    while more == 1:
        count += 1
        more = count < 5
    out[3 * i] = count
    out[3 * i + 1] = 10 if is_zero(mask[i]) else 20
    if 0 <= mask[i] < 1:
        out[3 * i + 2] += 1
    if count == 5 == True:
        out[3 * i + 2] += 10


def test_conditions(device):
    mask = wp.array([True, False], dtype=wp.bool, device=device)
    out = wp.zeros(6, dtype=int, device=device)
    wp.launch(conditions, 2, [mask], [out], device=device)
    assert out.numpy().tolist() == [5, 20, 0, 0, 10, 1]


def test_masked_gradient():
    @wp.kernel
    def kernel(mask: wp.array(dtype=wp.bool), x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        if mask[i] == 0:
            y[i] = x[i] * x[i]

    mask = wp.array([True, False], dtype=wp.bool, device="cpu")
    x = wp.array([2.0, 3.0], dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, 2, [mask, x, y], device="cpu")
    tape.backward(grads={y: wp.ones(2, dtype=float, device="cpu")})
    np.testing.assert_array_equal(x.grad.numpy(), [0.0, 6.0])


def test_composites_do_not_compare_with_truth():
    with pytest.raises(TypeError, match=r"no overload of '==' takes \(bool, vec3f\)"):
        run(
            define("@wp.kernel\ndef k(n: int, out: wp.array(dtype=float)):\n"
                   "    if (n == 1) == wp.vec3():\n        out[0] = 1.0\n")["k"], 1
        )  # fmt: skip
