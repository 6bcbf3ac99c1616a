"""Variables that start as constants keep what is written to their parts, on every path."""

from types import SimpleNamespace

import numpy as np
import pytest

import warp as wp
from frontend_programs import run

VECTOR = wp.constant(wp.vec3(1.0, 2.0, 3.0))
MATRIX = wp.types.matrix((2, 3), wp.float32)(*range(6))
TURN = wp.quat(0.0, 0.0, 0.0, 1.0)
FRAME = wp.transform((1.0, 2.0, 3.0), TURN)
HELD = SimpleNamespace(vector=wp.vec3(4.0, 5.0, 6.0))
PAIR = (wp.vec3(7.0, 8.0, 9.0), wp.vec3(0.0))
SEED = wp.constant(wp.uint32(7))


@wp.struct
class Inner:
    m: wp.mat22


@wp.struct
class Outer:
    x: float
    v: wp.vec3
    inner: Inner


WHOLE = Outer()
WHOLE.x = 1.5
WHOLE.v = wp.vec3(1.0, 2.0, 3.0)
WHOLE.inner.m = wp.mat22(1.0, 2.0, 3.0, 4.0)


@wp.func
def with_default(n: int, v: wp.vec3 = wp.vec3(1.0, 2.0, 3.0)):
    for i in range(n):
        v[i] = 20.0
    return v


@wp.func
def left_early(n: int):
    v = VECTOR
    for i in range(3):
        v[i] *= 10.0
        if i == n:
            return v
    return v


@wp.func
def set_part(v: wp.ref[wp.vec3], i: int):
    v[i] = 30.0


@wp.kernel
def vectors(n: int, out: wp.array2d(dtype=float)):
    for i in range(3):
        out[0, i] = with_default(n)[i]
        out[1, i] = left_early(1)[i]
    a = HELD.vector
    i = int(0)
    while True:
        if i == n:
            break
        a[i] += 10.0
        i += 1
    b, c = PAIR
    for i in range(n):
        b[i], c[i] = c[i], b[i]
    d = wp.static(wp.vec3(1.0, 2.0, 3.0) * 2.0)
    e = d
    for i in range(3):
        if i == 0:
            continue
        e.y += 1.0
    f = VECTOR if n > 5 else HELD.vector
    for i in range(n):
        for j in range(i + 1):
            f[j] -= 1.0
    g = VECTOR
    for i in range(n):
        set_part(g, i)
    for i in range(3):
        out[2, i] = a[i]
        out[3, i] = b[i] + 100.0 * c[i]
        out[4, i] = d[i] + 100.0 * e[i]
        out[5, i] = f[i]
        out[6, i] = g[i]
        out[7, i] = VECTOR[i] + HELD.vector[i]


def test_vectors(device):
    out = wp.zeros((8, 3), dtype=float, device=device)
    wp.launch(vectors, 1, [2], [out], device=device)
    expected = [
        [20, 20, 3],
        [10, 20, 3],
        [14, 15, 6],
        [700, 800, 9],
        [202, 604, 606],
        [2, 4, 6],
        [30, 30, 3],
        [5, 7, 9],
    ]
    assert out.numpy().tolist() == expected


@wp.kernel
def others(n: int, out: wp.array(dtype=float)):
    m = MATRIX
    for i in range(n):
        m[i] += VECTOR
        for j in range(n):
            m[i][j] *= 10.0
    q = TURN
    t = FRAME
    for i in range(n):
        q[i] = 5.0
        t.p[i] = 6.0
        t.q[i] -= 7.0
    s = WHOLE
    u = s
    for i in range(n):
        s.x += 1.0
        s.v[i] = 8.0
        s.inner.m[i][0] = 9.0
        if i == 1:
            u.v.z = 10.0
    for i in range(2):
        for j in range(3):
            out[3 * i + j] = m[i, j]
    out[6] = q[0] + q[1] + q[3]
    out[7] = t.p[1] + t.p[2]
    out[8] = t.q[1] + t.q[3]
    out[9] = s.x + s.v[1] + s.v[2]
    out[10] = s.inner.m[1, 0] + s.inner.m[1, 1]
    out[11] = u.v[2] + u.v[0] + u.x


def test_matrices_and_structs(device):
    out = wp.zeros(12, dtype=float, device=device)
    wp.launch(others, 1, [2], [out], device=device)
    assert out.numpy().tolist() == [10, 30, 5, 40, 60, 8, 11, 9, -6, 14.5, 13, 12.5]


@wp.kernel
def branches(n: int, out: wp.array(dtype=float)):
    a = VECTOR
    if n > 1:
        out[0] = 1.0
    else:
        a = HELD.vector
    b = VECTOR
    if n > 1:
        b = HELD.vector
    if n > 2:
        c = VECTOR
    else:
        c = HELD.vector
    s = WHOLE
    if n == 2:
        s = Outer()
    t = (VECTOR, 1.0)
    if n == 2:
        t = (HELD.vector, 2.0)
    else:
        t = (VECTOR + HELD.vector, 3.0)
    u = SEED
    if n == 2:
        u = wp.static(wp.uint32(9))
    d = VECTOR
    for i in range(n):
        if i == 1:
            d = HELD.vector
            continue
        d = VECTOR
    out[1] = a[0]
    out[2] = b[0]
    out[3] = c[0]
    out[4] = s.x + s.v[0]
    out[5] = t[0][0] + t[1]
    out[6] = float(u)
    out[7] = d[0]


@pytest.mark.parametrize(
    "n, expected",
    [
        (0, [0, 4, 1, 4, 2.5, 8, 7, 1]),
        (2, [1, 1, 4, 4, 0, 6, 9, 4]),
        (3, [1, 1, 4, 1, 2.5, 8, 7, 1]),
    ],
)
def test_branches_choose_constants(n, expected):
    """Constants that one side or both assign, whole."""
    out = wp.zeros(8, dtype=float, device="cpu")
    wp.launch(branches, 1, [n, out], device="cpu")
    assert out.numpy().tolist() == expected


def test_states_of_random_numbers_advance():
    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        state = SEED
        other = wp.uint32(7)
        for i in range(n):
            out[2 * i] = wp.randf(state)
            out[2 * i + 1] = wp.randf(other)

    found = np.reshape(run(kernel, 3)[:6], (3, 2))
    assert (found[:, 0] == found[:, 1]).all() and len(set(found[:, 0])) == 3


def test_values_of_an_enclosing_function():
    start = wp.vec2(1.0, 2.0)

    @wp.kernel
    def kernel(n: int, out: wp.array(dtype=float)):
        v = start
        for i in range(n):
            v[i] += 1.0
        out[0] = v[0]
        out[1] = v[1]

    assert run(kernel, 2)[:2] == [2.0, 3.0]
    assert list(start) == [1.0, 2.0]


@wp.kernel
def scaled(n: int, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    v = VECTOR
    for k in range(n):
        v[k] *= x[i] * float(k + 1)
    y[i] = wp.dot(v, v)


def test_gradients():
    """y = x^2 + (2 * 2 x)^2 + 9, so y' = 34 x."""
    x = wp.array([2.0, 3.0], dtype=float, device="cpu", requires_grad=True)
    y = wp.zeros(2, dtype=float, device="cpu", requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(scaled, 2, [2, x], [y], device="cpu")
    y.grad.fill_(1.0)
    tape.backward()
    assert y.numpy().tolist() == [77.0, 162.0]
    assert x.grad.numpy().tolist() == [68.0, 102.0]


def test_constants_stay():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        VECTOR[0] = out[0]

    with pytest.raises(wp.WarpCodegenError, match="expects a variable"):
        run(kernel)
