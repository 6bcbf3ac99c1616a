"""Errors of constant tables."""

import re

import numpy as np
import pytest

import warp as wp

SINGLE = np.arange(27, dtype=np.float32)


@pytest.mark.parametrize(
    ("table", "problem"),
    [
        (np.array([1 + 2j]), "a constant table holds numbers, but the array has 'complex128'"),
        (np.zeros((2, 0)), "has 1 to 1048576 numbers, but this one has 0"),
        (np.zeros((1024, 1025), bool), "has 1 to 1048576 numbers, but this one has 1049600"),
        (np.zeros((2, 2, 2, 2)), "but this one has shape (2, 2, 2)"),
        ((1e60, 1.0), "number 1e+60 does not fit 'float32'"),
        ((2**40, 1), "integer 1099511627776 does not fit 'int32'"),
        ((1.0, "a"), "the index of a tuple must be an integer known at compile time"),
        ((1.0, (1.0, 2.0)), "the index of a tuple must be an integer known at compile time"),
    ],
)
def test_errors_name_the_table(table, problem):
    @wp.kernel
    def read(o: wp.array(dtype=float)):
        o[0] = float(table[wp.tid()])

    with pytest.raises(wp.WarpCodegenError) as error:
        wp.launch(read, 1, [wp.zeros(1, dtype=float, device="cpu")], device="cpu")
    assert problem in str(error.value)


def test_errors_of_indices():
    @wp.kernel
    def beyond(o: wp.array(dtype=float)):
        o[0] = SINGLE[27]

    @wp.kernel
    def many(o: wp.array(dtype=float)):
        o[0] = SINGLE[0, wp.tid()]

    @wp.kernel
    def written(o: wp.array(dtype=float)):
        SINGLE[wp.tid()] = 1.0

    out = wp.zeros(1, dtype=float, device="cpu")
    for kernel, problem in (
        (beyond, "index 27 is out of range for a table with 27 elements"),
        (many, "expects at most 1 index for a table of shape (27,), but got 2"),
        (written, "cannot assign to a part of 'SINGLE'"),
    ):
        with pytest.raises(wp.WarpCodegenError, match=re.escape(problem)):
            wp.launch(kernel, 1, [out], device="cpu")
