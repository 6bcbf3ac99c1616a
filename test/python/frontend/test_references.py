"""Parameters by reference: what functions assign to them, and its derivatives."""

import typing

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@wp.struct
class Body:
    mass: float
    velocity: wp.vec3


@wp.func
def add(x: wp.ref[float], delta: float):
    x += delta


@wp.func
def swap(a: wp.ref[float], b: wp.ref[float]):
    a, b = b, a


@wp.func
def clip(x: wp.ref[float], limit: float) -> bool:
    if x <= limit:
        return False
    x = limit
    return True


@wp.func
def push(body: wp.ref[Body], force: wp.vec3, dt: float):
    body.velocity += force * (dt / body.mass)
    add(body.mass, 1.0)


@wp.func
def scale(x: wp.ref[typing.Any], factor: typing.Any):
    x = x * factor


@wp.func
def looked_at(x: wp.ref[float]):
    return x * 2.0


@wp.func
def bump(x: wp.ref[float], by: int):
    x += float(by)


@wp.func
def bump(n: wp.ref[int], by: int):  # noqa: F811
    n += by


@wp.func
def bump(by: int, count: wp.ref[wp.int64] = 3):  # noqa: F811
    count += wp.int64(by)
    return count


def launched(kernel, device, *arrays, dim=1):
    made = [wp.array(one, dtype=float, device=device) for one in arrays]
    wp.launch(kernel, dim, made, device=device)
    return [one.numpy() for one in made]


def test_variables_components_and_elements(device):
    @wp.kernel
    def update(x: wp.array(dtype=float), y: wp.array2d(dtype=float)):
        a = x[0]
        add(a, 10.0)
        x[0] = a
        add(x[1], 20.0)
        v = wp.vec3(1.0, 2.0, 3.0)
        add(v[1], delta=5.0)
        swap(v.x, v.z)
        swap(x[2], b=x[3])
        y[0, 0] = v[0]
        y[0, 1] = v[1]
        y[0, 2] = v[2]
        row = y[1]
        add(row[2], 7.0)
        scale(y[1, 0], 3.0)
        n = int(4)
        scale(n, 2)
        y[1, 1] = float(n)

    x, y = launched(update, device, [1.0, 2.0, 3.0, 4.0], [[0, 0, 0], [1, 1, 1]])
    np.testing.assert_array_equal(x, [11, 22, 4, 3])
    np.testing.assert_array_equal(y, [[3, 7, 1], [3, 8, 8]])


def test_structs_and_results(device):
    @wp.kernel
    def update(x: wp.array(dtype=float)):
        body = Body()
        body.mass = 2.0
        push(body, wp.vec3(0.0, 4.0, 0.0), 0.5)
        x[0] = body.mass
        x[1] = body.velocity[1]
        if clip(x[2], 1.0):
            x[3] += 1.0
        if clip(x[4], 1.0):
            x[3] += 10.0

    (x,) = launched(update, device, [0.0, 0.0, 5.0, 0.0, 0.5])
    np.testing.assert_array_equal(x, [3, 1, 1, 1, 0.5])


def test_loops_and_branches_carry_them(device):
    @wp.kernel
    def update(x: wp.array(dtype=float), n: wp.array(dtype=float)):
        total = float(0.0)
        k = int(0)
        while k < int(n[0]):
            if k % 2 == 0:
                add(total, x[k])
            else:
                clip(total, 3.0)
            scale(k, 1)
            k += 1
        x[0] = total

    (x, _) = launched(update, device, [1.0, 9.0, 8.0, 9.0, 4.0], [5.0])
    # 1, then 9 clipped to 3, then 7.
    np.testing.assert_array_equal(x, [7, 9, 8, 9, 4])


def test_overloads_and_defaults(device):
    @wp.kernel
    def update(x: wp.array(dtype=float)):
        k = int(1)
        bump(k, 4)
        bump(x[0], by=k)
        wide = wp.int64(10)
        bump(7, wide)
        x[1] = float(wide)
        x[2] = float(bump(7))
        x[3] = float(bump(1, count=wide))
        x[4] = float(wide)

    (x,) = launched(update, device, [0.5, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(x, [5.5, 17, 10, 18, 18])


def test_what_is_not_assigned_is_not_stored(device):
    @wp.kernel
    def read(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = looked_at(x[i])

    x = wp.array([1.0, 2.0], dtype=float, device=device)
    y = wp.zeros(2, dtype=float, device=device)
    wp.launch(read, 2, [x, y], device=device)
    np.testing.assert_array_equal(y.numpy(), [2, 4])
    assert read.ir().count("warp.store") == 1


def test_gradients(device):
    @wp.kernel
    def roll(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        a = x[i]
        b = float(1.0)
        for k in range(3):
            scale(b, a)
            add(b, float(k))
            swap(a, b)
        add(y[i], a * b)

    values, w = np.array([0.5, -1.5, 2.0]), np.array([1.0, 2.0, -3.0])

    def reference(a):
        b = 1.0
        for k in range(3):
            a, b = b * a + k, a
        return a * b

    x = wp.array(values, dtype=wp.float32, device=device, requires_grad=True)
    y = wp.zeros(3, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(roll, 3, [x, y], device=device)
    np.testing.assert_allclose(y.numpy(), reference(values), rtol=1e-6)
    tape.backward(grads={y: wp.array(w, dtype=float, device=device)})
    step = 1e-20
    expected = w * reference(values + 1j * step).imag / step
    np.testing.assert_allclose(x.grad.numpy(), expected, rtol=1e-5)


def test_annotations():
    assert wp.ref[float] == wp.ref[float] != wp.ref[int]
    assert hash(wp.ref[float]) == hash(wp.ref[float])
    assert wp.ref[wp.vec3].dtype is wp.ref[wp.vec3].value_type is wp.vec3
    assert repr(wp.ref[wp.int32]) == "wp.ref[int32]"


def test_what_cannot_be_passed():
    @wp.func
    def made() -> float:
        return 1.0

    @wp.kernel
    def literal(x: wp.array(dtype=float)):
        add(1.0, 2.0)

    @wp.kernel
    def result(x: wp.array(dtype=float)):
        add(made(), 2.0)

    @wp.kernel
    def sum(x: wp.array(dtype=float)):
        add(x[0] + 1.0, 2.0)

    @wp.kernel
    def whole_number(x: wp.array(dtype=float)):
        n = int(1)
        add(n, 2.0)

    @wp.kernel
    def constant(x: wp.array(dtype=float)):
        n = 4
        scale(n, 2)

    @wp.kernel
    def derivative(x: wp.array(dtype=float)):
        x[0] = wp.grad(looked_at)(x[0])

    @wp.kernel
    def parameter(x: wp.ref[float]):
        x = 1.0

    for kernel, message in [
        (literal, "a variable or an element of an array, to pass by reference"),
        (result, "a variable or an element of an array, to pass by reference"),
        (sum, "a variable or an element of an array, to pass by reference"),
        (whole_number, "cannot call 'add' with"),
        (constant, r"(?s)'n' is the constant 4.*`n = wp.int32\(4\)`"),
        (derivative, "'looked_at' has parameters by reference"),
        (parameter, "parameter 'x' of kernel '.*' cannot be a reference"),
    ]:
        with pytest.raises(errors.WarpCodegenError, match=message):
            kernel.ir()


@wp.func
def second(rows: wp.ref[wp.array2d[float]], i: int) -> float:
    same = rows
    return same[i][1]


@wp.func_grad(second)
def second_adjoint(rows: wp.ref[wp.array2d[float]], i: int, cotangent: float):
    wp.adjoint[rows][i, 1] += 3.0 * cotangent


@wp.func
def double(values: wp.ref[wp.array[float]], i: int):
    values[i] = 2.0 * values[i]


def test_arrays_refer_to_their_elements(device):
    @wp.kernel
    def run(rows: wp.array2d[float], out: wp.array[float]):
        i = wp.tid()
        out[i] = second(rows, i)
        double(out, i)

    rows = wp.array([[2.0, 3.0], [4.0, 5.0]], dtype=float, device=device, requires_grad=True)
    out = wp.zeros(2, dtype=float, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(run, 2, [rows], [out], device=device)
    assert out.numpy().tolist() == [6.0, 10.0]
    tape.backward(grads={out: wp.ones_like(out)})
    assert rows.grad.numpy().tolist() == [[0.0, 6.0], [0.0, 6.0]]
