"""Arrays that only some paths assign: the others have none, as an array of no extent."""

import numpy as np

import warp as wp


@wp.func
def element(a: wp.array(dtype=wp.vec3), i: int):
    return a[i]


@wp.kernel
def choose(
    a: wp.array(dtype=wp.vec3),
    b: wp.array(dtype=wp.vec3),
    kinds: wp.array(dtype=int),
    out: wp.array(dtype=wp.vec3),
    lengths: wp.array(dtype=int),
):
    i = wp.tid()
    kind = kinds[i]
    if kind == 1:
        some = a
    elif kind == 2:
        some = b
    if kind == 1 or kind == 2:
        out[i] = element(some, i)
    lengths[i] = some.shape[0]


def test_arrays_assigned_on_some_paths(device):
    x = np.arange(18.0, dtype=np.float32).reshape(6, 3)
    kinds = np.array([1, 2, 0, 1, 2, 3])
    a = wp.array(x, dtype=wp.vec3, device=device)
    b = wp.array(np.vstack([x, x]) + 100.0, dtype=wp.vec3, device=device)
    out = wp.full(6, wp.vec3(-1.0), dtype=wp.vec3, device=device)
    lengths = wp.zeros(6, dtype=int, device=device)
    given = [a, b, wp.array(kinds, dtype=int, device=device)]
    wp.launch(choose, 6, given, [out, lengths], device=device)
    expected = np.where((kinds == 1)[:, None], x, np.where((kinds == 2)[:, None], x + 100.0, -1.0))
    np.testing.assert_array_equal(out.numpy(), expected)
    assert lengths.numpy().tolist() == [6, 12, 0, 6, 12, 0]


def test_gradients_reach_the_array_of_each_path(device):
    a, b = (wp.ones(6, dtype=wp.vec3, requires_grad=True, device=device) for _ in range(2))
    out = wp.zeros(6, dtype=wp.vec3, requires_grad=True, device=device)
    kinds = np.array([1, 2, 0, 1, 2, 3])
    given = [a, b, wp.array(kinds, dtype=int, device=device)]
    with wp.Tape() as tape:
        wp.launch(choose, 6, given, [out, wp.zeros(6, dtype=int, device=device)], device=device)
    tape.backward(grads={out: wp.full_like(out, wp.vec3(1.0, 2.0, 3.0))})
    for array, kind in ((a, 1), (b, 2)):
        expected = np.outer(kinds == kind, [1.0, 2.0, 3.0])
        np.testing.assert_array_equal(array.grad.numpy(), expected)
