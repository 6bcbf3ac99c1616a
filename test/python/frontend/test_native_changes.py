"""Native functions that change vectors, matrices and structs, which they get by reference."""

import pytest

import warp as wp

Vectors = wp.array(dtype=wp.vec3)


@wp.struct
class Inner:
    v: wp.vec3
    n: int


@wp.struct
class State:
    inner: Inner
    weight: float
    table: wp.array(dtype=float)


@wp.func_native("v[0] += 1.0f; v[2] = v[1];")
def change_vector(v: wp.ref[wp.vec3]): ...


@wp.func_native("s.weight += s.table.data[0]; s.inner.v[1] = 5.0f; s.inner.n = 7;")
def change_struct(s: wp.ref[State]): ...


@wp.func_native("x += a.data[0]; n = 3; a.data[0] = 9.0f;")
def change_numbers(a: wp.array(dtype=float), x: wp.ref[float], n: wp.ref[int]): ...


@wp.func_native("m[1][1] = 4.0f; return m[0][0] + s;")
def change_matrix(m: wp.ref[wp.mat22], s: float) -> float: ...


@wp.func_native("v *= 2.0f;", adj_snippet="adj_v *= 2.0f;")
def with_adjoint(v: wp.ref[wp.vec3]): ...


@wp.kernel(enable_backward=False)
def vectors(out: Vectors):
    v = wp.vec3(1.0, 2.0, 3.0)
    change_vector(v)
    out[0] = v
    change_vector(out[1])


@wp.kernel(enable_backward=False)
def structs(table: wp.array(dtype=float), out: Vectors):
    s = State()
    s.table = table
    s.weight = 1.0
    s.inner.v = wp.vec3(1.0, 2.0, 3.0)
    change_struct(s)
    out[0] = s.inner.v
    out[1] = wp.vec3(s.weight, float(s.inner.n), s.table[1])


@wp.kernel(enable_backward=False)
def numbers(table: wp.array(dtype=float), out: Vectors):
    x, n = float(1.0), int(0)
    change_numbers(table, x, n)
    out[0] = wp.vec3(x, float(n), table[0])


@wp.kernel(enable_backward=False)
def matrices(out: Vectors):
    m = wp.mat22(1.0, 2.0, 3.0, 0.0)
    r = change_matrix(m, 0.5)
    out[0] = wp.vec3(r, m[1, 1], m[0, 1])


@wp.kernel
def smooth(x: Vectors, out: Vectors):
    v = x[0]
    change_vector(v)
    out[0] = v


@wp.kernel
def adjoint(out: Vectors):
    v = out[0]
    with_adjoint(v)
    out[0] = v


@pytest.mark.parametrize(
    "kernel, expected",
    [
        (vectors, [[2.0, 2.0, 2.0], [1.0, 0.0, 0.0]]),
        (structs, [[1.0, 5.0, 3.0], [8.0, 7.0, 8.0]]),
        (numbers, [[8.0, 3.0, 9.0], [0.0, 0.0, 0.0]]),
        (matrices, [[1.5, 4.0, 2.0], [0.0, 0.0, 0.0]]),
    ],
)
def test_changes(kernel, expected, native_device):
    table, out = wp.array([7.0, 8.0], dtype=float), wp.zeros(2, dtype=wp.vec3)
    wp.launch(kernel, 1, [table, out] if kernel in (structs, numbers) else [out])
    assert out.numpy().tolist() == expected


def test_no_gradient_without_an_adjoint(native_device):
    x = wp.ones(1, dtype=wp.vec3, requires_grad=True)
    out = wp.zeros(1, dtype=wp.vec3, requires_grad=True)
    with pytest.raises(wp.WarpError, match="change_vector|derivative"):
        with wp.Tape() as tape:
            wp.launch(smooth, 1, [x, out])
        tape.backward(grads={out: wp.ones(1, dtype=wp.vec3)})
        wp.synchronize()


def test_an_adjoint_is_refused(native_device):
    with pytest.raises(wp.WarpError, match="'with_adjoint', which changes the .* 'v',"):
        wp.launch(adjoint, 1, [wp.ones(1, dtype=wp.vec3)])
        wp.synchronize()
