"""`checkpoint`: schedules, and gradients that are those of the full tape."""

import numpy as np
import pytest

import warp as wp
from warp._src.autograd.revolve import Reversal, first_sweep

N = 16


@wp.kernel
def spring_forces(x: wp.array(dtype=float), k: wp.array(dtype=float), f: wp.array(dtype=float)):
    i = wp.tid()
    stretch = x[i + 1] - x[i]
    g = k[i] * stretch * (1.0 + 0.1 * stretch * stretch)
    wp.atomic_add(f, i, g)
    wp.atomic_sub(f, i + 1, g)


@wp.kernel
def move(x: wp.array(dtype=float), v: wp.array(dtype=float), f: wp.array(dtype=float), dt: float):
    i = wp.tid()
    w = v[i] + dt * f[i]
    v[i] = w
    x[i] = x[i] + dt * w


@wp.kernel
def square_norm(x: wp.array(dtype=float), loss: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(loss, 0, x[i] * x[i])


class Chain:
    """A chain of masses and springs."""

    def __init__(self, device):
        rng = np.random.default_rng(1)
        start = np.arange(N) + 0.1 * rng.normal(size=N)
        self.device = device
        self.x = wp.array(start, dtype=float, requires_grad=True, device=device)
        self.v = wp.zeros(N, dtype=float, requires_grad=True, device=device)
        self.f = wp.zeros(N, dtype=float, requires_grad=True, device=device)
        self.k = wp.full(N - 1, 2.0, dtype=float, requires_grad=True, device=device)
        self.loss = wp.zeros(1, dtype=float, requires_grad=True, device=device)
        self.count = 0

    def step(self, number):
        self.count += 1
        self.f.zero_()
        wp.launch(spring_forces, N - 1, [self.x, self.k, self.f], device=self.device)
        wp.launch(move, N, [self.x, self.v, self.f, 0.01], device=self.device)

    def run(self, steps, snapshots=None, preserve="auto"):
        with wp.Tape(preserve=preserve) as tape:
            if snapshots is None:
                for number in range(steps):
                    self.step(number)
            else:
                wp.autograd.checkpoint(self.step, steps, [self.x, self.v], snapshots)
            wp.launch(square_norm, N, [self.x, self.loss], device=self.device)
        tape.backward(self.loss)
        return tape

    def gradients(self):
        return [one.grad.numpy().copy() for one in (self.x, self.v, self.k, self.f)]


@pytest.mark.parametrize(
    "steps, copies", [(1, 1), (2, 1), (9, 1), (9, 2), (50, 3), (200, 8), (5, 9)]
)
def test_schedule(steps, copies):
    kept_now, reversed_steps, here = set(), [], [0]
    most = 0

    def keep(k):
        nonlocal most
        assert here[0] == k
        kept_now.add(k)
        most = max(most, len(kept_now))

    def restore(k):
        assert k in kept_now
        here[0] = k

    def advance(k):
        assert here[0] == k
        here[0] = k + 1

    def reverse(k):
        assert here[0] == k
        reversed_steps.append(k)

    plan = first_sweep(steps, copies)
    starts = {start for start, _ in plan}
    for k in range(steps):
        if k in starts:
            keep(k)
        advance(k)
    Reversal(keep, restore, kept_now.discard, advance, reverse).run(steps, plan)
    assert reversed_steps == list(range(steps))[::-1]
    assert most <= copies


@pytest.mark.parametrize("snapshots", [1, 2, 3, 8, 40])
def test_gradients_are_those_of_the_full_tape(snapshots):
    full, part = Chain("cpu"), Chain("cpu")
    full.run(30)
    part.run(30, snapshots)
    assert np.array_equal(full.x.numpy(), part.x.numpy())
    assert np.array_equal(full.v.numpy(), part.v.numpy())
    for one, other in zip(full.gradients(), part.gradients()):
        assert one.tobytes() == other.tobytes()


def test_a_long_rollout(device):
    full, part = Chain(device), Chain(device)
    full.run(1000)
    part.run(1000, 8)
    assert part.count < 7000
    exact = device == "cpu"
    for one, other in zip(full.gradients(), part.gradients()):
        assert one.tobytes() == other.tobytes() if exact else np.allclose(one, other, rtol=1e-3)


def test_two_backward_passes(device):
    chain = Chain(device)
    tape = chain.run(20, 4)
    first = chain.gradients()
    tape.zero()
    tape.backward(chain.loss)
    for one, other in zip(first, chain.gradients()):
        assert np.allclose(one, other, rtol=1e-5)


def test_constants_that_change_later(device):
    chain = Chain(device)
    with wp.Tape(preserve="never") as tape:
        wp.autograd.checkpoint(chain.step, 10, [chain.x, chain.v], 3)
    chain.k.fill_(1.0)
    seed = wp.ones(N, dtype=float, device=device)
    with pytest.raises(RuntimeError, match="overwritten by the fill_"):
        tape.backward(grads={chain.x: seed})
    kept, reference = Chain(device), Chain(device)
    with wp.Tape(preserve="auto") as tape:
        wp.autograd.checkpoint(kept.step, 10, [kept.x, kept.v], 3)
    kept.k.fill_(1.0)
    tape.backward(grads={kept.x: seed})
    assert (kept.k.numpy() == 1).all()
    with wp.Tape() as tape:
        wp.autograd.checkpoint(reference.step, 10, [reference.x, reference.v], 3)
    tape.backward(grads={reference.x: seed})
    assert np.allclose(kept.x.grad.numpy(), reference.x.grad.numpy(), rtol=1e-5)


def test_state_that_is_not_listed(device):
    chain = Chain(device)
    with wp.Tape(), pytest.raises(RuntimeError, match="array 'v'.*not in `state`"):
        wp.autograd.checkpoint(chain.step, 10, [chain.x], 3)


def test_without_a_tape_the_steps_run(device):
    chain = Chain(device)
    wp.autograd.checkpoint(chain.step, 5, [chain.x, chain.v], 2)
    assert chain.count == 5
    with pytest.raises(ValueError, match="snapshot"):
        wp.autograd.checkpoint(chain.step, 5, [chain.x, chain.v], 0)
