"""Checks on 1 to 4 ranks of MPI and on gloo: values, bits, gradients, bad input."""

import math

import numpy as np
import pytest

PASSING = (
    *("halo_values", "halo_of_any_type", "random_partitions", "push_and_halo", "bad_blocks"),
    *("adjoints_of_halos", "adjoints_of_some_fields", "adjoints_in_shared_memory"),
    *("reductions", "movements", "dot_tests", "products"),
    *("debug_mode", "disagreement", "bad_input", "lifetime"),
    *("linear_operations", "extrema_and_products", "derivatives_along_directions"),
    *("second_derivatives", "tangents_on_tapes", "points_in_forward_mode"),
    *("products_in_forward_mode", "disagreement_in_forward_mode", "many_fields_on_a_tape"),
    *("graph_operations", "bad_graphs", "block_systems"),
    *("checkpoints", "shared_memory", "warm_and_progress"),
    *("migration_adjoint", "bad_particles", "fixed_adjoints", "bad_fixed_particles"),
)
SAME_BITS = (
    "jacobi",
    "lattice",
    "exact_sums",
    "products_and_solvers",
    "fused_solver",
    "polynomials",
    "matrix_free",
    "discs",
    "fixed_capacities",
)
ROWS, COLUMNS, STEPS = 24, 16, 10


@pytest.mark.parametrize("check", PASSING)
def test_passes_on_ranks(found, engine, size, check):
    facts = found(engine, size)
    assert check in facts, sorted(facts)
    assert facts[check] is None, facts[check]["error"]


@pytest.mark.parametrize("check", SAME_BITS)
def test_same_bits_on_ranks(found, engine, size, check):
    facts, alone = found(engine, size)[check], found("none", 1)[check]
    assert "error" not in str(facts), facts
    assert facts == alone


def test_captures_equal_eager_steps(found, engine, size):
    fact = found(engine, size)["capture"]
    assert isinstance(fact, list), fact
    assert math.isclose(fact[1], found("none", 1)["capture"][1], rel_tol=1e-7)


def loss(theta, x):
    """The loss of the split program, in float64."""
    x = np.pad(x, 1)
    for _ in range(STEPS):
        c = x[1:-1, 1:-1]
        around = x[:-2, 1:-1] + x[2:, 1:-1] + x[1:-1, :-2] + x[1:-1, 2:]
        x = np.pad(c + theta[0] * (around - 4 * c) - theta[1] * c**3, 1)
    return ((x[1:-1, 1:-1] - 0.3) ** 2).sum()


def test_gradients_are_those_of_one_program(found, engine, size):
    fact = found(engine, size)["gradient"]
    assert isinstance(fact, list), fact
    value, by_theta, by_state = (np.array(one) for one in fact)
    x = np.random.default_rng(7).random((ROWS, COLUMNS)).astype(np.float32).astype(float)
    theta = np.array([0.2, 0.05], np.float32).astype(float)
    assert np.isclose(value[0], loss(theta, x), rtol=1e-5)
    for k in range(2):
        step = np.eye(2)[k] * 1e-6
        wanted = (loss(theta + step, x) - loss(theta - step, x)) / 2e-6
        assert np.isclose(by_theta[k], wanted, rtol=2e-4, atol=2e-3)
    for i, j in ((0, 0), (11, 7), (12, 8), (23, 15)):
        step = np.zeros_like(x)
        step[i, j] = 1e-6
        wanted = (loss(theta, x + step) - loss(theta, x - step)) / 2e-6
        assert np.isclose(by_state[i, j], wanted, rtol=1e-4, atol=1e-5)
    alone = [np.array(one) for one in found("none", 1)["gradient"]]
    for one, other in zip((value, by_theta, by_state), alone, strict=True):
        assert np.abs(one - other).max() <= 1e-6 * np.abs(other).max()
