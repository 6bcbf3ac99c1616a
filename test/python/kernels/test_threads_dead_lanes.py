"""Threads that a guard keeps from code don't run it, whatever their neighbours do.

Values of such threads are wild: indices far outside, zero divisors, steps that would never end a
loop, numbers that make NaN. Each kernel runs with several patterns of such threads.
"""

import numpy as np
import pytest

from threads_launches import SIZES, Launches

FAR = 1 << 30
HEAD = """
@wp.kernel(module_options=OPTIONS)
def k(x: wp.array(dtype=float), v: wp.array(dtype=wp.vec3), place: wp.array(dtype=int),
      alive: wp.array(dtype=int), y: wp.array(dtype=float), m: wp.array(dtype=int),
      u: wp.array(dtype=wp.vec3), s: wp.array(dtype=float), n: int):
    i = wp.tid()
"""
ELEMENTS = ("float", "wp.vec3", "int", "int", "float", "int", "wp.vec3", "float")
BODIES = {
    "gather": """
if alive[i] == 1:
    y[i] = x[place[i]] + 1.0
""",
    "gather in one arm": """
if alive[i] == 1:
    y[i] = x[place[i]]
    m[i] = place[place[i]]
else:
    y[i] = -1.0
""",
    "return before a gather": """
if alive[i] == 0:
    return
y[i] = x[place[i]] + x[i]
m[i] = place[i]
""",
    "vectors": """
if alive[i] == 1:
    p = v[place[i]]
    u[i] = p + v[i]
    y[i] = p[2]
""",
    "stores": """
if alive[i] == 1:
    j = place[i]
    m[j] = j + 1
""",
    "condition": """
j = place[i]
if j >= 0 and j < n and x[j] > 1.0:
    y[i] = x[j]
""",
    "ternary": """
j = place[i]
y[i] = x[j] if alive[i] == 1 else 7.0
""",
    "quotients": """
d = place[i] if alive[i] == 1 else 0
if d != 0:
    m[i] = wp.div(1000, d) + wp.mod(1000, d) + 77 // d
""",
    "roots": """
a = x[i] if alive[i] == 1 else -1.0
if a >= 0.0:
    y[i] = wp.sqrt(a) / (a + 1.0)
    wp.atomic_add(s, 0, float(int(a * 4.0)))
""",
    "maximum of numbers": """
a = wp.sqrt(x[i] if alive[i] == 1 else -1.0)
if a == a:
    wp.atomic_max(s, 1, a)
    wp.atomic_min(s, 2, -a - 1.0)
""",
    "steps of zero": """
if alive[i] == 1:
    j = int(0)
    c = int(0)
    while j < 40:
        j += place[i] % 5 + 1
        c += 1
    m[i] = c
""",
    "loops without an end": """
j = int(0)
c = int(0)
if alive[i] == 1:
    while j < 40 and c < 50:
        j += place[i] % 5 + 1
        c += 1
    m[i] = c
else:
    m[i] = -1
""",
    "trips": """
if alive[i] == 1:
    c = int(0)
    for j in range(place[i] % 9):
        c += m[i] + j
    m[i] = c
""",
    "break before a gather": """
c = float(0.0)
for j in range(8):
    if alive[i] == 0 or j > i % 5:
        break
    c += x[place[i] + j % 2]
y[i] = c
""",
    "continue before a gather": """
c = int(0)
for j in range(6):
    if alive[i] == 0:
        continue
    if (i + j) % 3 == 0:
        continue
    c += place[place[i]]
m[i] = c
""",
    "function": """
if alive[i] == 1:
    y[i] = fetch(x, place[i], i)
""",
    "local array": """
t = Local()
for j in range(4):
    t[j] = i + j
if alive[i] == 1:
    t[place[i] % 4] = 9
    m[i] = t[place[i] % 4] + t[3]
""",
    "sums": """
if alive[i] == 1:
    wp.atomic_add(m, place[i], 3)
    wp.atomic_add(s, i % 3, x[place[i]] * 0.25)
""",
    "take and clear": """
a = y[i]
if alive[i] == 1:
    a = x[i]
    x[i] = 0.0
y[i] = a
""",
}
PRELUDE = """
Local = wp.types.vector(4, wp.int32)


@wp.func
def fetch(x: wp.array(dtype=float), j: int, i: int):
    if i % 3 == 0:
        return -1.0
    return x[j]

"""
PATTERNS = {
    "all": lambda n, random: np.ones(n, int),
    "none": lambda n, random: np.zeros(n, int),
    "one": lambda n, random: (np.arange(n) == n // 2).astype(int),
    "all but one": lambda n, random: (np.arange(n) != n // 2).astype(int),
    "blocks": lambda n, random: np.arange(n) // 16 % 2,
    "half": lambda n, random: random.integers(0, 2, n),
}


def arrays(n, pattern, unique):
    """Arguments; places of threads that are not alive are far outside."""
    random = np.random.default_rng(n)
    alive = PATTERNS[pattern](n, random).astype(np.int32)
    inside = random.permutation(n) if unique else random.integers(0, max(n, 1), n)
    wild = random.choice([FAR, -FAR, -(1 << 31), (1 << 31) - 1], n)
    quarters = (random.integers(-20, 20, (n + 2, 4)) / 4).astype(np.float32)
    zeros = np.zeros(n + 2, np.int32)
    return {
        "x": np.abs(quarters[:, 0]),
        "v": quarters[:, 1:].copy(),
        "place": np.where(alive == 1, inside, wild).astype(np.int32),
        "alive": alive,
        "y": quarters[:, 1].copy(),
        "m": zeros,
        "u": np.zeros((n + 2, 3), np.float32),
        "s": np.zeros(4, np.float32),
    }


@pytest.mark.parametrize("name", BODIES)
def test_threads_that_are_not_there_do_nothing(device, name):
    body = "".join(f"    {line}\n" for line in BODIES[name].strip().splitlines())
    launches = Launches(PRELUDE + HEAD + body, ELEMENTS)
    for n in SIZES:
        for pattern in PATTERNS:
            host = arrays(n, pattern, unique=name == "stores")
            launches.check((n,), host, [n], device)
