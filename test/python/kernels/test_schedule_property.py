"""However a kernel is scheduled, results and gradients are those of debug mode on the CPU."""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from random_runs import seeds
from schedule_programs import Program

SIZES = [(1, 8), (33, 40), (257, 100), (1000, 65), (96, 33)]


def run(program, mode, size, device):
    """Contents of g, h and s, and gradients of all arrays."""
    names = {"E": program.element, "S": program.real}
    kernel = define(program.text, **names)["k"]
    wp.set_module_options({"mode": mode}, kernel.module)
    threads, trips = size
    random = np.random.default_rng(threads)
    shape = (max(size) + 2, *program.shape)
    arrays = [
        wp.array(random.standard_normal(shape), program.element, device=device, requires_grad=True)
        for _ in range(4)
    ]
    arrays.append(wp.zeros(1, dtype=program.real, device=device, requires_grad=True))
    with wp.Tape() as tape:
        block_dim = 64 if trips % 2 else 256
        wp.launch(kernel, threads, [*arrays, *size], device=device, block_dim=block_dim)
    results = [one.numpy().copy() for one in arrays[2:]]
    seeds = [wp.array(random.standard_normal(shape), program.element, device=device)] * 2
    seeds.append(wp.full(1, 0.7, dtype=program.real, device=device))
    tape.backward(grads=dict(zip(arrays[2:], seeds, strict=True)))
    return results + [one.grad.numpy() for one in arrays]


@pytest.mark.parametrize("seed", seeds(60))
def test_schedules_agree(device, seed):
    program = Program(seed)
    size = SIZES[seed % len(SIZES)]
    expected = run(program, "debug", size, "cpu")
    found = run(program, "release", size, device)
    tolerance = 1e-9 if program.real is wp.float64 else 3e-3
    for name, one, other in zip("g h s dx dy dg dh ds".split(), found, expected, strict=True):
        scale = max(1.0, np.abs(other).max())
        message = f"{name} of\n{program.text}"
        assert np.allclose(one, other, rtol=tolerance, atol=tolerance * scale), message
