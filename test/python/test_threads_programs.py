"""However threads run, a random kernel computes what Python computes, bit for bit."""

import numpy as np
import pytest

import threads_programs as programs

MODES = {"normal": {}, "debug": {"mode": "debug"}}
SIZES = (0, 1, 3, 15, 16, 17, 63, 64, 65, 1000)
SHAPES = {2: ((1, 1), (3, 17), (16, 4), (5, 64)), 3: ((1, 2, 3), (2, 3, 16), (3, 1, 33))}


def bits(values):
    """Numbers as integers; every NaN is the same."""
    if values.dtype.kind != "f":
        return values
    values = np.where(np.isnan(values), values.dtype.type(np.nan), values)
    return values.view(f"u{values.dtype.itemsize}")


def assert_same(found, expected, message):
    for name, want in expected.items():
        for part in want.dtype.names or (None,):
            got, other = (bits(one[part] if part else one) for one in (found[name], want))
            np.testing.assert_array_equal(got, other, err_msg=f"{name}.{part} {message}")


def check(program, dims, device):
    spaces = {key: programs.compile_program(program.text, one) for key, one in MODES.items()}
    for seed, dim in enumerate(dims):
        expected = programs.expect(program.text, spaces["normal"], dim, seed)
        for mode, space in spaces.items():
            found = programs.run(space, dim, seed, device)
            assert_same(found, expected, f"in {mode} mode with {dim} threads of\n{program.text}")


@pytest.mark.parametrize("seed", range(40))
def test_launches_of_every_size(device, seed):
    check(programs.Program(seed), [(n,) for n in SIZES], device)


@pytest.mark.parametrize("rank", SHAPES)
@pytest.mark.parametrize("seed", range(100, 110))
def test_launches_of_more_dimensions(device, seed, rank):
    check(programs.Program(seed, rank), SHAPES[rank], device)


@pytest.mark.parametrize("seed", range(200, 220))
def test_modes_agree_where_arithmetic_rounds(device, seed):
    program = programs.Program(seed, exact=False)
    spaces = {key: programs.compile_program(program.text, one) for key, one in MODES.items()}
    for n in SIZES:
        expected = programs.run(spaces["debug"], (n,), n, device)
        for mode, space in spaces.items():
            found = programs.run(space, (n,), n, device)
            assert_same(found, expected, f"in {mode} mode with {n} threads of\n{program.text}")
