"""Elements of every number of components pass through registers unchanged, at any step."""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from threads_launches import MODES

TEXT = """
Element = wp.types.vector(COUNT, TYPE)


@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=Element), alive: wp.array(dtype=int), same: wp.array(dtype=Element),
      half: wp.array(dtype=Element), some: wp.array(dtype=Element), last: wp.array(dtype=TYPE)):
    i = wp.tid()
    v = x[i]
    same[i] = v + v
    half[i] = x[2 * i + 1]
    last[i] = x[3 * i][COUNT - 1]
    if alive[i] == 1:
        some[i] = x[i + 1]
"""
TYPES = {"float32": 4, "float64": 8, "uint8": 1, "int16": 2}


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 6, 8, 9, 10, 12, 16, 17])
@pytest.mark.parametrize("kind", TYPES)
def test_copies(device, kind, count):
    random = np.random.default_rng(count)
    for mode, options in MODES.items():
        space = define(TEXT, OPTIONS=options, COUNT=count, TYPE=getattr(wp, kind))
        for n in (1, 15, 16, 33, 70):
            # The last thread's elements are the last ones of the array.
            values = random.integers(0, 100, (3 * n, count)).astype(kind)
            alive = random.integers(0, 2, n).astype(np.int32)
            x = wp.array(values, dtype=space["Element"], device=device)
            found = [wp.zeros(n, dtype=space["Element"], device=device) for _ in range(3)]
            last = wp.zeros(n, dtype=getattr(wp, kind), device=device)
            arrays = [x, wp.array(alive, device=device), *found, last]
            wp.launch(space["k"], n, arrays, device=device)
            expected = [values[:n] * 2, values[1 : 2 * n : 2], values[1 : n + 1] * alive[:, None]]
            for got, want in zip(found, expected, strict=True):
                got = got.numpy().reshape(n, count)
                np.testing.assert_array_equal(got, want, err_msg=f"{mode}, {n} threads")
            np.testing.assert_array_equal(last.numpy(), values[: 3 * n : 3, -1])
