"""Elements of a few bytes that lanes read from anywhere, beside the same choice by NumPy."""

import numpy as np
import pytest

import warp as wp

COLOURS = [wp.vec3ub, wp.vec4ub, wp.types.vector(3, wp.int8), wp.types.vector(4, wp.int8)]


@wp.struct
class Mixed:
    first: wp.int8
    second: wp.uint8
    third: wp.float16


@pytest.mark.parametrize("dtype", COLOURS, ids=["vec3ub", "vec4ub", "vec3b", "vec4b"])
@pytest.mark.parametrize("start", [0, 1, 2, 3])
def test_gather_colours(dtype, start, device):
    length = dtype._length_

    @wp.kernel(module="unique", module_options={"cpu_lanes": 16})
    def pick(a: wp.array(dtype=dtype), at: wp.array(dtype=int), out: wp.array2d(dtype=int)):
        i = wp.tid()
        if at[i] >= 0:
            c = a[at[i]]
            for k in range(wp.static(length)):
                out[i, k] = int(c[k])

    random = np.random.default_rng(5)
    low, high = (
        (0, 256) if "u" in np.dtype(wp.dtype_to_numpy(dtype._wp_scalar_type_)).kind else (-128, 128)
    )
    values = random.integers(low, high, (200, length))
    at = random.integers(-40, 200 - start, 333)
    at[:3] = [0, 199 - start, 199 - start]
    given = wp.array(values, dtype=dtype, device=device)[start:]
    out = wp.full((333, length), -1000, dtype=int, device=device)
    wp.launch(pick, 333, [given, wp.array(at, dtype=int, device=device)], [out], device=device)
    expected = np.where(at[:, None] >= 0, values[start:][at], -1000)
    np.testing.assert_array_equal(out.numpy(), expected)


def test_gather_structs(device):
    @wp.kernel(module="unique", module_options={"cpu_lanes": 16})
    def pick(a: wp.array(dtype=Mixed), at: wp.array(dtype=int), out: wp.array2d(dtype=float)):
        i = wp.tid()
        s = a[at[i]]
        out[i, 0] = float(s.first)
        out[i, 1] = float(s.second)
        out[i, 2] = float(s.third)

    random = np.random.default_rng(6)
    values = np.zeros(100, dtype=Mixed.numpy_dtype())
    values["first"] = random.integers(-128, 128, 100)
    values["second"] = random.integers(0, 256, 100)
    values["third"] = random.uniform(-9.0, 9.0, 100)
    at = random.integers(0, 100, 77)
    out = wp.zeros((77, 3), dtype=float, device=device)
    given = wp.array(values, dtype=Mixed, device=device)
    wp.launch(pick, 77, [given, wp.array(at, dtype=int, device=device)], [out], device=device)
    columns = [values[name][at].astype(np.float32) for name in ("first", "second", "third")]
    np.testing.assert_array_equal(out.numpy(), np.stack(columns, 1))
