"""Random programs: what a kernel computes is what Python computes."""

import numpy as np
from hypothesis import given

import warp as wp
from frontend_programs import define, programs, remainder
from random_runs import examples

PRELUDE = """
@wp.func
def rem(a: int, b: int):
    return a % b

"""
KERNEL = """
@wp.kernel
def kernel(out: wp.array(dtype=int), n: int, s: int):
    i = wp.tid()
    out[i] = program(i - 3, i * 2, n, s)
"""
COUNT = 8


def wrapped(value):
    return (value + 2**31) % 2**32 - 2**31


@examples(60)
@given(programs())
def test_random_programs_agree_with_python(source):
    plain = define(source, rem=remainder)["program"]
    kernel = define(PRELUDE + "@wp.func\n" + source + KERNEL)["kernel"]
    for n, s in ((4, 1), (5, 2)):
        out = wp.zeros(COUNT, dtype=int, device="cpu")
        wp.launch(kernel, COUNT, [out, n, s], device="cpu")
        expected = [wrapped(plain(i - 3, i * 2, n, s)) for i in range(COUNT)]
        np.testing.assert_array_equal(out.numpy(), expected, err_msg=source)
