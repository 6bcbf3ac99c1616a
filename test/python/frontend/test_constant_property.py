"""Random programs on variables that start as constants compute what Python computes."""

import numpy as np
from hypothesis import given

import warp as wp
from constant_programs import MATRIX, NAMES, PLACES, PLAIN_NAMES, VECTOR, WHOLE, programs, sources
from frontend_programs import define
from random_runs import examples


@examples(40)
@given(programs())
def test_random_programs_agree_with_python(text):
    source, plain = sources(text)
    program = define(plain, **PLAIN_NAMES)["program"]
    kernel = define(source, **NAMES)["kernel"]
    constants = bytes(VECTOR), bytes(MATRIX), bytes(WHOLE)
    for n in (0, 3):
        out = wp.zeros((4, len(PLACES)), dtype=int, device="cpu")
        wp.launch(kernel, 4, [n, out], device="cpu")
        records = [program(i - 2, n) for i in range(4)]
        expected = [[eval(f"r.{place}", {"r": r}) for place in PLACES] for r in records]
        np.testing.assert_array_equal(out.numpy(), expected, err_msg=source)
    assert constants == (bytes(VECTOR), bytes(MATRIX), bytes(WHOLE))
