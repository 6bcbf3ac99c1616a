"""Elements of several numbers in rows, one row for each thread (`pose[world, body]`).

On a GPU the threads of a warp that are at the same place of their rows move elements together; so
sizes here leave parts of warps, loops end at different places, and places differ between threads.
"""

import numpy as np
import pytest

import warp as wp

WORLDS = (1, 31, 32, 33, 100, 257)
BODIES = 5
V12 = wp.types.vector(12, wp.float64)


@wp.kernel
def follow(
    x: wp.array2d(dtype=wp.transform),
    parent: wp.array(dtype=int),
    count: wp.array(dtype=int),
    y: wp.array2d(dtype=wp.transform),
):
    w = wp.tid()
    for k in range(count[w]):
        p = parent[k]
        if p >= 0:
            y[w, k] = x[w, k] + y[w, p] * 0.5
        else:
            y[w, k] = x[w, k]


def follow_in_numpy(x, parent, count):
    y = np.zeros_like(x)
    for w in range(len(x)):
        for k in range(count[w]):
            y[w, k] = x[w, k] + (0.5 * y[w, parent[k]] if parent[k] >= 0 else 0.0)
    return y


def gradient_of_follow(seed, parent, count):
    seed, grad = seed.copy(), np.zeros_like(seed)
    for w in range(len(seed)):
        for k in reversed(range(count[w])):
            grad[w, k] = seed[w, k]
            if parent[k] >= 0:
                seed[w, parent[k]] += 0.5 * seed[w, k]
    return grad


@pytest.mark.parametrize("ragged", [False, True])
@pytest.mark.parametrize("worlds", WORLDS)
def test_trees(device, worlds, ragged):
    """Rows that a loop reads and writes, forward and backward."""
    rng = np.random.default_rng(worlds)
    parent = np.array([-1, 0, 0, 1, 3])
    count = rng.integers(0, BODIES + 1, worlds) if ragged else np.full(worlds, BODIES)
    x, seed = rng.normal(size=(2, worlds, BODIES, 7))
    given = wp.array(x, dtype=wp.transform, device=device, requires_grad=True)
    y = wp.zeros((worlds, BODIES), dtype=wp.transform, device=device, requires_grad=True)
    whole = [wp.array(one, dtype=int, device=device) for one in (parent, count)]
    with wp.Tape() as tape:
        wp.launch(follow, worlds, [given, *whole, y], device=device)
    np.testing.assert_allclose(y.numpy(), follow_in_numpy(x, parent, count), rtol=1e-5, atol=1e-5)
    tape.backward(grads={y: wp.array(seed, dtype=wp.transform, device=device)})
    wanted = gradient_of_follow(seed, parent, count)
    np.testing.assert_allclose(given.grad.numpy(), wanted, rtol=1e-5, atol=1e-5)


@wp.kernel
def at_places(
    x: wp.array3d(dtype=V12),
    place: wp.array(dtype=int),
    y: wp.array3d(dtype=V12),
    z: wp.array2d(dtype=V12),
):
    b, w = wp.tid()
    p = place[w]
    y[b, w, p] = x[b, w, p] * wp.float64(2.0)
    z[w, b] = x[b, w, 1] - x[b, w, 2]


@pytest.mark.parametrize("same", [True, False])
@pytest.mark.parametrize("shape", [(3, 17), (2, 32), (5, 64), (1, 257), (70, 3)])
def test_places(device, shape, same):
    """Places from memory, the same in all threads or not, and rows in the first dimension."""
    rng = np.random.default_rng(7)
    x = rng.normal(size=(*shape, 3, 12))
    place = np.full(shape[1], 2) if same else rng.integers(0, 3, shape[1])
    given = wp.array(x, dtype=V12, device=device)
    y = wp.zeros((*shape, 3), dtype=V12, device=device)
    z = wp.zeros(shape[::-1], dtype=V12, device=device)
    whole = wp.array(place, dtype=int, device=device)
    wp.launch(at_places, shape, [given, whole, y, z], device=device)
    wanted = np.zeros_like(x)
    columns = np.arange(shape[1])
    wanted[:, columns, place] = 2.0 * x[:, columns, place]
    np.testing.assert_array_equal(y.numpy(), wanted)
    np.testing.assert_array_equal(z.numpy(), (x[:, :, 1] - x[:, :, 2]).swapaxes(0, 1))
