"""Derivatives of atomic minima and maxima where numbers are NaN.

Such an update leaves NaN only where it finds nothing else. Then the first thread with NaN has the
derivative, as the first of threads with equal numbers.
"""

import numpy as np
import pytest

import warp as wp

NAN = np.nan
# The number in the array, those of two threads, and the thread whose number a minimum leaves.
CASES = [
    (NAN, (NAN, NAN), 0),
    (NAN, (NAN, 2.0), 1),
    (NAN, (2.0, NAN), 0),
    (1.0, (NAN, NAN), None),
    (1.0, (NAN, 0.5), 1),
]


def program(update, dtype):
    def run(x: wp.array(dtype=dtype), best: wp.array(dtype=dtype)):
        update(best, 0, x[wp.tid()])

    return wp.kernel(run, module="unique")


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64, wp.float16, wp.vec3])
@pytest.mark.parametrize("update", [wp.atomic_min, wp.atomic_max])
@pytest.mark.parametrize(("held", "given", "winner"), CASES)
def test_the_number_that_is_left_has_the_gradient(update, dtype, held, given, winner, device):
    sign = -1.0 if update is wp.atomic_max else 1.0
    shape = (2, 3) if dtype is wp.vec3 else (2,)
    values = np.broadcast_to(sign * np.array(given).reshape(2, *[1] * (len(shape) - 1)), shape)
    x = wp.array(values, dtype=dtype, requires_grad=True, device=device)
    best = wp.array(np.full((1, *shape[1:]), sign * held), dtype=dtype, requires_grad=True,
                    device=device)  # fmt: skip
    with wp.Tape() as tape:
        wp.launch(program(update, dtype), 2, [x, best], device=device)
    best.grad.fill_(5.0)
    tape.backward()
    wanted = np.zeros(shape)
    if winner is not None:
        wanted[winner] = 5.0
    gradients = x.grad.numpy().astype(float)
    if np.isnan(given).all():
        # Either thread may have been the first.
        gradients, wanted = gradients.sum(axis=0), wanted.sum(axis=0)
    np.testing.assert_array_equal(gradients, wanted)


@pytest.mark.parametrize("update", [wp.atomic_min, wp.atomic_max])
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize(("held", "given", "winner"), CASES)
def test_tangents(update, threads, held, given, winner, device):
    """One thread keeps value and tangent together, several look for the one that is left."""
    sign = -1.0 if update is wp.atomic_max else 1.0
    kernel = program(update, float)

    if threads == 1:

        def run(x: wp.array(dtype=float), best: wp.array(dtype=float)):
            for i in range(2):
                update(best, 0, x[i])

        kernel = wp.kernel(run, module="unique")

    def evaluate(x):
        best = wp.full(1, sign * held, dtype=float, device=device)
        wp.launch(kernel, threads, [x, best], device=device)
        return best

    x = wp.array(sign * np.array(given), dtype=float, device=device)
    tangent = wp.full(2, 3.0, dtype=float, device=device)
    found = wp.autograd.jvp(evaluate, [x], [tangent])
    # One thread leaves the NaN that was there first, which has no tangent.
    is_left = winner is not None and not (threads == 1 and np.isnan(given).all())
    assert found.numpy()[0] == (3.0 if is_left else 0.0)
