"""Bad input of scans, sorts, runs, sums, matrices and solvers, and its messages."""

import pytest

import warp as wp
import warp.optim.linear as linear
import warp.sparse as sp

utils = wp.utils


def floats(*shape, dtype=float):
    return lambda device: wp.zeros(shape, dtype=dtype, device=device)


def ints(*values):
    return lambda device: wp.array(values, dtype=int, device=device)


def rows_of(*values):
    """A diagonal matrix with numbers in its first rows."""
    count = len(values)
    at = ints(*range(count))
    return lambda device: sp.bsr_from_triplets(
        2, 2, at(device), at(device), wp.array(values, dtype=float, device=device)
    )


EYE = rows_of(1.0, 1.0)
SORTED = floats(8), ints(*[0] * 8), 4

CASES = [
    # Types of elements.
    (utils.array_scan, [floats(4, dtype=wp.float16)] * 2, "Unsupported data type: float16"),
    (utils.radix_sort_pairs, [floats(8), floats(8, dtype=wp.vec3), 4], "Unsupported .* vec3f"),
    (utils.runlength_encode, [floats(1), floats(1), ints(0)], "Unsupported data type: float32"),
    (utils.array_sum, [floats(3, dtype=wp.int32)], "Unsupported data type: int32"),
    (utils.array_inner, [floats(3), floats(3, dtype=wp.float64)], "float32 vs float64"),
    (sp.bsr_mv, [EYE, floats(2, dtype=wp.float64)], "expected float32, got float64"),
    (sp.bsr_set_diag, [EYE, floats(2, dtype=wp.mat33)], "blocks of type float32, got .* mat33f"),
    (linear.cg, [EYE, floats(2, dtype=wp.float64), floats(2)], "type float32, got float64"),
    # Lengths and ranks.
    (utils.array_scan, [floats(4), floats(3)], r"do not match \(4 vs 3\)"),
    (utils.array_inner, [floats(3), floats(4)], r"same shape, got \(3,\) and \(4,\)"),
    (utils.array_sum, [floats(3), None, 9], "takes 0 to 3 elements, got a count of 9"),
    (utils.radix_sort_pairs, [floats(4), ints(0, 0, 0, 0), 4], r"contain 2\*count elements"),
    (utils.runlength_encode, [ints(1, 1, 2), ints(0), ints(0)], r"equal to value_count \(3\)"),
    (utils.segmented_sort_pairs, [*SORTED, ints(0, 1), ints(4)], r"same size \(2 vs 1\)"),
    (sp.bsr_from_triplets, [2, 2, ints(0), ints(0, 1), floats(2)], "the same length"),
    (sp.bsr_mv, [EYE, floats(3)], "expected 2, got 3"),
    (linear.cg, [EYE, floats(3), floats(3)], "expected 2 numbers, got 3"),
    # Negative numbers.
    (utils.radix_sort_pairs, [floats(8), ints(*[0] * 8), -1], "must be non-negative, got -1"),
    (utils.runlength_encode, [ints(1), ints(0), ints(0), None, -2], "non-negative, got -2"),
    (sp.bsr_zeros, [-1, 2, float], "rows and columns >= 0, got -1"),
    (linear.cg, [EYE, floats(2), floats(2), -1.0], "tolerances >= 0, got tol=-1.0"),
    # Layout and memory that is shared.
    (
        utils.radix_sort_pairs,
        [lambda device: floats(16)(device)[::2], ints(*[0] * 8), 4],
        "requires a contiguous keys array",
    ),
    # Shapes of matrices.
    (sp.bsr_mm, [EYE, lambda device: sp.bsr_zeros(3, 3, float, device)], "Incompatible number"),
    (sp.bsr_axpy, [EYE, lambda device: sp.bsr_zeros(3, 3, float, device)], "same number of rows"),
    (linear.preconditioner, [EYE, "nope"], "Unsupported preconditioner type 'nope'"),
]


@pytest.mark.parametrize("function, given, message", CASES)
def test_refusals(device, function, given, message):
    given = [one(device) if callable(one) and one is not float else one for one in given]
    with pytest.raises((RuntimeError, TypeError, ValueError), match=message):
        function(*given)


def test_arrays_that_are_one(device):
    both = ints(3, 1, 0, 0)(device)
    with pytest.raises(RuntimeError, match="requires arrays that do not overlap"):
        utils.radix_sort_pairs(both, both, 2)
    line = floats(4)(device)
    with pytest.raises(RuntimeError, match="overlap; use the same array or different memory"):
        utils.array_scan(line[1:], line[:3])


def test_a_breakdown_names_its_iteration(device):
    ones = wp.ones(2, dtype=float, device=device)
    with pytest.warns(UserWarning, match="cg: breakdown in iteration 1: the matrix is singular"):
        _, error, atol = linear.cg(rows_of(1.0)(device), ones, floats(2)(device), maxiter=50)
    assert error > atol


def test_arrays_on_another_device(device):
    if not wp.get_device(device).is_cuda:
        pytest.skip("needs two kinds of devices")
    with pytest.raises(RuntimeError, match="device"):
        utils.array_scan(floats(4)(device), floats(4)("cpu"))
    with pytest.raises((RuntimeError, ValueError), match="device"):
        sp.bsr_mv(EYE(device), floats(2)("cpu"))
