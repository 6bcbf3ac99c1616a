"""Elements of every number of components pass through registers unchanged, from anywhere."""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from threads_launches import MODES, modes_on

VECTORS = """
Element = wp.types.vector(COUNT, TYPE)


@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=Element), alive: wp.array(dtype=int), place: wp.array(dtype=int),
      same: wp.array(dtype=Element), half: wp.array(dtype=Element), some: wp.array(dtype=Element),
      moved: wp.array(dtype=Element), last: wp.array(dtype=TYPE)):
    i = wp.tid()
    v = x[i]
    same[i] = v + v
    half[i] = x[2 * i + 1]
    last[i] = x[3 * i][COUNT - 1]
    if alive[i] == 1:
        some[i] = x[i + 1]
        moved[i] = x[place[i]]
"""
STRUCTS = """
@wp.struct
class Element:
    a: int
    p: wp.vec3
    b: wp.uint32
    q: wp.vec2
    c: wp.int32


@wp.struct
class Wide:
    a: wp.int64
    p: wp.vec2d
    b: wp.uint64
    c: wp.float64


@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=Element), w: wp.array(dtype=Wide), place: wp.array(dtype=int), n: int,
      same: wp.array(dtype=Element), moved: wp.array(dtype=Element), wide: wp.array(dtype=Wide)):
    i = wp.tid()
    e = x[i]
    e.a = e.a + 1
    e.q = e.q * 2.0
    same[i] = e
    if place[i] < n:
        moved[i] = x[place[i]]
        f = w[i]
        f.b = f.b + wp.uint64(3)
        wide[place[i]] = f
"""
TYPES = ("float32", "float64", "uint8", "int16")
SIZES = (1, 15, 16, 33, 70)


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 8, 9, 10, 12, 16, 17])
@pytest.mark.parametrize("kind", TYPES)
def test_vectors(device, kind, count):
    random = np.random.default_rng(count)
    for mode, options in modes_on(device).items():
        space = define(VECTORS, OPTIONS=options, COUNT=count, TYPE=getattr(wp, kind))
        for n in SIZES:
            # The last thread's elements are the last ones of the array.
            values = random.integers(0, 100, (3 * n, count)).astype(kind)
            alive = random.integers(0, 2, n).astype(np.int32)
            place = np.where(alive == 1, random.integers(0, 3 * n, n), 1 << 30).astype(np.int32)
            arrays = [wp.array(values, dtype=space["Element"], device=device)]
            arrays += [wp.array(one, device=device) for one in (alive, place)]
            found = [wp.zeros(n, dtype=space["Element"], device=device) for _ in range(4)]
            last = wp.zeros(n, dtype=getattr(wp, kind), device=device)
            wp.launch(space["k"], n, [*arrays, *found, last], device=device)
            live = alive[:, None].astype(kind)
            expected = [values[:n] * 2, values[1 : 2 * n : 2], values[1 : n + 1] * live]
            expected.append(values[place % (3 * n)] * live)
            for got, want in zip(found, expected, strict=True):
                got = got.numpy().reshape(n, count)
                np.testing.assert_array_equal(got, want, err_msg=f"{mode}, {n} threads")
            np.testing.assert_array_equal(last.numpy(), values[: 3 * n : 3, -1])


def some(dtype, n, random):
    """Structs of small numbers, each field other ones."""
    made = np.zeros(n, np.dtype(dtype))
    for name in made.dtype.names:
        made[name] = random.integers(0, 100, made[name].shape)
    return made


@pytest.mark.parametrize("mode", MODES)
def test_structs(device, mode):
    space = define(STRUCTS, OPTIONS=MODES[mode])
    kinds = [space[name] for name in ("Element", "Wide")]
    for n in SIZES:
        random = np.random.default_rng(n)
        x, w = (some(kind.numpy_dtype(), n, random) for kind in kinds)
        place = random.permutation(n).astype(np.int32)
        place[::3] += 1 << 30
        inside = place < n
        given = [
            wp.array(one, dtype=kind, device=device)
            for one, kind in zip((x, w), kinds, strict=True)
        ]
        given += [wp.array(place, device=device), n]
        found = [wp.zeros(n, dtype=kinds[k], device=device) for k in (0, 0, 1)]
        wp.launch(space["k"], n, given + found, device=device)
        moved, wide = np.zeros_like(x), np.zeros_like(w)
        moved[inside] = x[place[inside]]
        wide[place[inside]] = w[inside]
        wide["b"][place[inside]] += np.uint64(3)
        x["a"] += 1
        x["q"] *= 2
        for got, want in zip(found, (x, moved, wide), strict=True):
            for name in want.dtype.names:
                np.testing.assert_array_equal(got.numpy()[name], want[name], err_msg=name)
