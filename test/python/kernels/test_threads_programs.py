"""However threads run, a random kernel computes what Python computes, bit for bit."""

import pytest

import threads_programs as programs
from random_runs import seeds
from threads_launches import SIZES, assert_same, compile_program, modes_on

SHAPES = {2: ((1, 1), (3, 17), (16, 4), (5, 64)), 3: ((1, 2, 3), (2, 3, 16), (3, 1, 33))}


def check(program, dims, device):
    spaces = {key: compile_program(program.text, one) for key, one in modes_on(device).items()}
    for seed, dim in enumerate(dims):
        expected = programs.expect(program.text, spaces["normal"], dim, seed)
        for mode, space in spaces.items():
            found = programs.run(space, dim, seed, device)
            assert_same(found, expected, f"in {mode} mode with {dim} threads of\n{program.text}")


@pytest.mark.parametrize("seed", seeds(40))
def test_launches_of_every_size(device, seed):
    check(programs.Program(seed), [(n,) for n in SIZES], device)


@pytest.mark.parametrize("seed", seeds(60, 300))
def test_short_programs(device, seed):
    check(programs.Program(seed, short=True), [(n,) for n in (1, 15, 17, 64, 65, 200)], device)


@pytest.mark.parametrize("rank", SHAPES)
@pytest.mark.parametrize("seed", seeds(10, 100))
def test_launches_of_more_dimensions(device, seed, rank):
    check(programs.Program(seed, rank), SHAPES[rank], device)


@pytest.mark.parametrize("seed", seeds(20, 200))
def test_modes_agree_where_arithmetic_rounds(device, seed):
    program = programs.Program(seed, exact=False)
    spaces = {key: compile_program(program.text, one) for key, one in modes_on(device).items()}
    for n in SIZES:
        expected = programs.run(spaces["debug"], (n,), n, device)
        for mode, space in spaces.items():
            found = programs.run(space, (n,), n, device)
            assert_same(found, expected, f"in {mode} mode with {n} threads of\n{program.text}")
