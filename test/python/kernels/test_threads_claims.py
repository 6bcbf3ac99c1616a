"""The compiler's claims about values of random kernels hold in every thread.

A debugging launch of a kernel with an argument `warp_claims` tests, value by value, that threads
agree, have values with a constant step, sums of indices and trips, ranges, indices of their own.
"""

import numpy as np
import pytest

import threads_programs as programs
import warp as wp
from threads_launches import compile_program

DIMS = {1: ((1,), (50,)), 2: ((3, 17),), 3: ((2, 3, 19),)}
FAILED, LAST, TABLE = 0, 1, 8


def with_claims(text):
    """The kernel of a text, with the argument for claims."""
    head, parameter, rest = text.partition("    w: int,\n")
    assert parameter
    return head + parameter + "    warp_claims: wp.array(dtype=wp.int64),\n" + rest


def launch(space, dim, seed, device, claims):
    """Launch on the arrays of a seed; the elements of `claims` afterwards."""
    n, h, w = programs.extents(dim)
    arrays = [
        wp.array(data, dtype=eval(programs.ELEMENTS[name], space), device=device)
        for name, data in programs.fill(space, n, seed).items()
    ]
    wp.launch(space["k"], dim, [*arrays, n, h, w, claims], device=device)
    return claims.numpy()


def table(device):
    return wp.zeros(TABLE + (1 << 17), dtype=wp.int64, device=device)


PROGRAMS = [(seed, rank) for seed in range(400, 412) for rank in DIMS]


@pytest.mark.parametrize("seed, rank", PROGRAMS)
def test_no_claim_is_false(device, seed, rank):
    text = with_claims(programs.Program(seed, rank).text)
    space = compile_program(text, {"mode": "debug"})
    for dim in DIMS[rank]:
        found = launch(space, dim, seed, device, table(device))
        message = f"claim {found[LAST]} with {dim} threads of\n{text}"
        assert found[FAILED] == 0, message
        # A test of a value leaves its key in the table; one thread alone enters fewer branches.
        tested = np.count_nonzero(found[TABLE:])
        assert tested > (50 if np.prod(dim) > 1 else 5), f"{tested} tested, {message}"


def test_a_false_claim_is_found(device):
    """Two launches are no single one: what is the same in one differs between them."""
    text = with_claims(programs.Program(400).text)
    space = compile_program(text, {"mode": "debug"})
    claims = table(device)
    assert launch(space, (40,), 1, device, claims)[FAILED] == 0
    assert launch(space, (41,), 1, device, claims)[FAILED] > 0


def test_only_debugging_launches_test(device):
    space = compile_program(with_claims(programs.Program(400).text), {})
    assert not launch(space, (40,), 1, device, table(device)).any()
