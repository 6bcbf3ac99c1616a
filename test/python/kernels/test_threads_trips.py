"""Threads that leave a loop after very different numbers of iterations.

Results are those of threads one by one, whatever is before the loop and after it. Numbers have few
digits, so that no sum rounds.
"""

import numpy as np
import pytest

import warp as wp
from threads_launches import SIZES, Launches

HEAD = """
@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=float), v: wp.array(dtype=wp.vec3), place: wp.array(dtype=int),
      y: wp.array(dtype=float), m: wp.array(dtype=int), u: wp.array(dtype=wp.vec3), n: int):
    i = wp.tid()
"""
ELEMENTS = ("float", "wp.vec3", "int", "float", "int", "wp.vec3")
BODIES = {
    "counts": """
j = m[i] % 97 + 1
c = int(0)
while j != 1 and c < 60:
    if j % 2 == 0:
        j = j // 2
    else:
        j = 3 * j + 1
    c += 1
m[i] = c
""",
    "what is kept": """
a = x[i] * 0.5
p = v[place[i]]
z = a
c = int(0)
while z * z < 40.0 + p[1] and c < n:
    z = z + a * 0.5 + p[0] * 0.125 - 0.25
    c += 1
y[i] = z + p[2]
m[i] = c + place[i]
u[i] = p * z
""",
    "gathers on the way": """
j = place[i]
c = int(0)
s = float(0.0)
while c < m[i] % 23:
    s = s + x[j] * 0.75 - 0.125
    j = place[j]
    c += 1
y[i] = s
""",
    "early return": """
if place[i] % 3 == 0:
    m[i] = -1
    return
z = x[i]
c = int(0)
while z < 30.0 and c < m[i] % 29:
    z = z + wp.abs(x[i]) * 2.5 + 0.25
    c += 1
if c > 5:
    m[i] = c
    y[i] = z
""",
    "updates after it": """
z = x[i]
c = int(0)
while z * z < 50.0 and c < m[i] % 31:
    z = z + 0.375 - x[i] * 0.25
    c += 1
wp.atomic_max(place, 0, c)
m[i] = c
""",
    "an end that is never reached by most": """
z = x[i]
c = int(0)
while c < 3 or (i % 37 == 5 and c < 200):
    z = z + 0.375 - x[i] * 0.25 + float(c % 3)
    c += 1
y[i] = z
""",
}


def arrays(size, rng):
    """Arrays of one element for each thread, and one for none."""
    size = max(size, 1)
    return {
        "x": rng.integers(-16, 16, size).astype(np.float32) / 8,
        "v": rng.integers(-16, 16, (size, 3)).astype(np.float32) / 8,
        "place": rng.integers(0, size, size).astype(np.int32),
        "y": rng.integers(-16, 16, size).astype(np.float32),
        "m": rng.integers(0, 1000, size).astype(np.int32),
        "u": np.zeros((size, 3), np.float32),
    }


@pytest.mark.parametrize("name", BODIES)
def test_lanes_have_the_results_of_threads_one_by_one(name):
    body = "".join(f"    {line}\n" for line in BODIES[name].strip("\n").split("\n"))
    launches = Launches(HEAD + body, ELEMENTS)
    rng = np.random.default_rng(7)
    for size in (*SIZES, 1023, 1025):
        launches.check(size, arrays(size, rng), [40], "cpu")


@wp.kernel
def escape(out: wp.array2d(dtype=wp.int32), most: int):
    i, j = wp.tid()
    a = float(j) / 40.0 - 2.0
    b = float(i) / 16.0 - 1.0
    z, w = float(0.0), float(0.0)
    c = int(0)
    while z * z + w * w < 4.0 and c < most:
        t = z * z - w * w + a
        w = 2.0 * z * w + b
        z = t
        c += 1
    out[i, j] = c


def test_rows_that_are_no_multiple_of_a_width():
    out = wp.zeros((33, 101), dtype=wp.int32, device="cpu")
    wp.launch(escape, out.shape, [out, 200], device="cpu")
    serial = wp.zeros_like(out)
    alone = wp.kernel(module="trips_alone", module_options={"cpu_lanes": 1})(escape.func)
    wp.launch(alone, out.shape, [serial, 200], device="cpu")
    np.testing.assert_array_equal(out.numpy(), serial.numpy())
    assert out.numpy().max() == 200 and out.numpy().min() < 3
