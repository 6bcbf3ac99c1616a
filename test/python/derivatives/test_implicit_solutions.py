"""`Tape.record_func` with a right-hand side and a solution that replaced a first guess, beside the
derivative by the implicit function theorem."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def residual(
    k: wp.array(dtype=wp.float64), p: wp.array(dtype=wp.float64), r: wp.array(dtype=wp.float64)
):
    """r = 6 - k p - p^3"""
    i = wp.tid()
    r[i] = wp.float64(6.0) - k[i] * p[i] - p[i] * p[i] * p[i]


@wp.kernel
def total(p: wp.array(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    i = wp.tid()
    wp.atomic_add(loss, 0, p[i] * p[i])


def made(values, device):
    return wp.array(values, dtype=wp.float64, requires_grad=True, device=device)


def solution(k):
    """The real root of p^3 + k p = 6."""
    return np.array([np.roots([1.0, 0.0, one, -6.0])[-1].real for one in k])


@pytest.mark.parametrize("guess", [0.0, 1.5])
@pytest.mark.parametrize("later", [False, True])
def test_derivatives_are_those_at_the_solution(device, guess, later):
    values = np.array([1.0, 2.0, 5.0])
    roots = solution(values)
    k, p, r, loss = (made(v, device) for v in (values, [guess] * 3, [0.0] * 3, [0.0]))
    with wp.Tape() as tape:
        wp.launch(residual, 3, [k, p], [r], device=device)
    p.assign(roots)

    def backward():
        """r.grad such that -(dr/dp)^T r.grad = p.grad."""
        r.grad.assign(p.grad.numpy() / (values + 3 * roots**2))
        p.grad.zero_()

    tape.record_func(backward, [r, p])
    with tape:
        wp.launch(total, 3, [p], [loss], device=device)
    if later:
        p.zero_()
    tape.backward(loss)
    slope = -roots / (values + 3 * roots**2)
    np.testing.assert_allclose(k.grad.numpy(), 2 * roots * slope, rtol=1e-12)


def test_without_copies_it_is_an_error(device):
    k, p, r = (made(v, device) for v in ([2.0], [0.0], [0.0]))
    with wp.Tape(preserve="never") as tape:
        wp.launch(residual, 1, [k, p], [r], device=device)
    p.fill_(1.0)
    tape.record_func(lambda: None, [r, p])
    with pytest.raises(RuntimeError, match="its array 'p' has been overwritten"):
        tape.backward(grads={r: wp.ones_like(r)})


@pytest.mark.parametrize("named", ["alone", "twice", "written"])
def test_other_arrays_keep_what_launches_have_read(device, named):
    """Received values, states of a rollout, and what the tape itself has computed."""
    k, p, r = (made(v, device) for v in ([2.0], [3.0], [0.0]))
    tape = wp.Tape()
    if named == "twice":
        tape.record_func(lambda: None, [p])
    with tape:
        if named == "written":
            p.fill_(3.0)
        wp.launch(residual, 1, [k, p], [r], device=device)
    p.fill_(1.0)
    tape.record_func(lambda: None, [p] if named == "alone" else [r, p])
    tape.backward(grads={r: wp.ones_like(r)})
    assert k.grad.numpy() == [-3.0]
