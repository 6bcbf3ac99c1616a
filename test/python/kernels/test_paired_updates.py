"""Sums of elements with an odd number of floats, wherever they begin in memory."""

import numpy as np
import pytest

import warp as wp

TYPES = {
    "vec3": (wp.vec3, (3,)),
    "vec5": (wp.types.vector(5, wp.float32), (5,)),
    "mat33": (wp.mat33, (3, 3)),
    "transform": (wp.transform, (7,)),
}


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("sign", [1, -1])
def test_scattered_sums(device, name, sign):
    kind, shape = TYPES[name]

    @wp.kernel(module="unique")
    def scatter(v: wp.array(dtype=kind), to: wp.array(dtype=int), out: wp.array(dtype=kind)):
        i = wp.tid()
        if wp.static(sign > 0):
            wp.atomic_add(out, to[i], v[i])
        else:
            wp.atomic_sub(out, to[i], v[i])

    random = np.random.default_rng(5)
    count, places = 1000, 33
    # Small integers: their sums are exact in any order.
    values = random.integers(-8, 8, (count, *shape)).astype(np.float32)
    to = random.integers(0, places, count).astype(np.int32)
    wanted = np.zeros((places + 2, *shape), dtype=np.float32)
    np.add.at(wanted, to + 1, sign * values)
    arrays = [wp.array(values, dtype=kind, device=device), wp.array(to, device=device)]
    room = wp.zeros(places + 2, dtype=kind, device=device)
    wp.launch(scatter, count, [*arrays, room[1:-1]], device=device)
    np.testing.assert_array_equal(room.numpy().reshape(wanted.shape), wanted)


def test_elements_that_begin_anywhere(device):
    """An array may begin between two multiples of eight; what is around it stays as it is."""

    @wp.kernel(module="unique")
    def add(to: wp.array(dtype=int), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        wp.atomic_add(out, to[i], wp.vec3(1.0, 2.0, float(i)))

    memory = wp.zeros(9, dtype=wp.vec3, device=device)
    shifted = wp.array(ptr=memory.ptr + 4, dtype=wp.vec3, shape=(8,), device=device)
    to = np.arange(64, dtype=np.int32) % 8
    wp.launch(add, 64, [wp.array(to, device=device), shifted], device=device)
    wanted = np.zeros((8, 3))
    np.add.at(wanted, to, np.stack([np.ones(64), 2 * np.ones(64), np.arange(64)], 1))
    got = memory.numpy().ravel()
    np.testing.assert_array_equal(got[1:25], wanted.ravel())
    assert not got[[0, 25, 26]].any()
