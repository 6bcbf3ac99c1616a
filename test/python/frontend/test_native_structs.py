"""Structs and transforms as parameters of native functions, alone and in arrays."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Material:
    density: float
    color: wp.vec3
    layers: int


@wp.struct
class Body:
    solid: bool
    material: Material
    pose: wp.transform
    inertia: wp.mat33
    mass: wp.float64
    samples: wp.array(dtype=float)


@wp.func_native("""
    float total = 0.0f;
    for (int i = 0; i < b.samples.shape[0]; ++i)
        total += b.samples.data[i];
    wp::vec3 at = wp::transform_point(b.pose, wp::mul(b.inertia, b.material.color));
    return (b.solid ? 1.0f : -1.0f) * (wp::dot(at, at) + total * b.material.density) +
           float(b.mass) * b.material.layers;
""")
def weigh(b: Body) -> float: ...


@wp.kernel(enable_backward=False)
def weigh_one(b: Body, out: wp.array(dtype=float)):
    out[wp.tid()] = weigh(b)


@wp.func_native("""
    for (int i = 0; i < bodies.shape[0]; ++i) {
        Material m = bodies.data[i].material;
        m.layers += i;
        m.color = m.color * 2.0f;
        bodies[i].material = m;
        bodies[i].mass = wp::transform_get_translation(bodies[i].pose)[1];
        out[i] = bodies[i].samples[1];
    }
""")
def change(bodies: wp.array(dtype=Body), out: wp.array(dtype=float)): ...


@wp.kernel(enable_backward=False)
def change_all(bodies: wp.array(dtype=Body), out: wp.array(dtype=float)):
    change(bodies, out)


@wp.func_native("return wp::transform_multiply(a, wp::transform_inverse(b));")
def between(a: wp.transformd, b: wp.transformd) -> wp.transformd: ...


@wp.kernel(enable_backward=False)
def all_between(
    a: wp.array(dtype=wp.transformd),
    b: wp.array(dtype=wp.transformd),
    out: wp.array(dtype=wp.transformd),
):
    i = wp.tid()
    out[i] = between(a[i], b[i])


@wp.func_native(
    "out[i] = m.density * wp::dot(m.color, m.color) * s.data[i];",
    """
    float g = adj_out[i];
    adj_m.density += g * wp::dot(m.color, m.color) * s.data[i];
    adj_m.color += m.color * (2.0f * g * m.density * s.data[i]);
    adj_s.data[i] += g * m.density * wp::dot(m.color, m.color);
    """,
)
def shade(m: Material, s: wp.array(dtype=float), i: int, out: wp.array(dtype=float)): ...


@wp.kernel
def shade_all(
    material: wp.array(dtype=Material), s: wp.array(dtype=float), out: wp.array(dtype=float)
):
    i = wp.tid()
    shade(material[i], s, i, out)


@wp.struct
class Signal:
    gain: float
    samples: wp.array(dtype=float)


@wp.func_native(
    "return s.gain * s.samples.data[i];",
    "adj_s.gain += adj_ret * s.samples.data[i]; adj_s.samples.data[i] += adj_ret * s.gain;",
)
def amplify(s: Signal, i: int) -> float: ...


@wp.kernel
def amplify_all(s: Signal, gain: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    own = Signal()
    own.gain = gain[i]
    own.samples = s.samples
    out[i] = amplify(own, i)


@wp.struct
class Narrow:
    a: wp.float16


@wp.func_native("return 0.0f;")
def of_narrow(n: Narrow) -> float: ...


@wp.kernel(enable_backward=False)
def run_of_narrow(n: Narrow, out: wp.array(dtype=float)):
    out[0] = of_narrow(n)


def test_a_field_without_a_type_in_cpp(native_device):
    with pytest.raises(wp.WarpError, match=r"'of_narrow', whose 'n' C\+\+ has no type for"):
        wp.launch(run_of_narrow, 1, [Narrow(), wp.zeros(1, dtype=float)])
        wp.synchronize()


def body(device, i=0):
    b = Body()
    b.solid = i % 2 == 0
    b.material.density, b.material.color, b.material.layers = 0.5 + i, wp.vec3(1.0, 2.0, 3.0), 4
    half = float(np.sqrt(0.5))
    b.pose = wp.transform(wp.vec3(1.0, 2.0 + i, 3.0), wp.quat(0.0, 0.0, half, half))
    b.inertia = wp.mat33(1.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0)
    b.mass = 2.0
    b.samples = wp.array([1.0, 2.0 + i], dtype=float, device=device)
    return b


@pytest.mark.parametrize("i", [0, 1])
def test_a_struct(native_device, i):
    out = wp.zeros(1, dtype=float, device=native_device)
    wp.launch(weigh_one, 1, [body(native_device, i)], [out], device=native_device)
    # A quarter turn about z of (5, 2, 6), moved by the translation.
    at = np.array([1.0 - 2.0, 2.0 + i + 5.0, 3.0 + 6.0])
    expected = (1.0 - 2.0 * i) * (at @ at + (3.0 + i) * (0.5 + i)) + 8.0
    np.testing.assert_allclose(out.numpy(), [expected], rtol=1e-6)


def test_an_array_of_structs(native_device):
    bodies = [body(native_device, i) for i in range(3)]
    array, out = wp.array(bodies, dtype=Body), wp.zeros(3, dtype=float)
    wp.launch(change_all, 1, [array, out])
    found = array.numpy()
    assert out.numpy().tolist() == [2.0, 3.0, 4.0]
    assert found["mass"].tolist() == [2.0, 3.0, 4.0]
    assert found["material"]["layers"].tolist() == [4, 5, 6]
    assert found["material"]["density"].tolist() == [0.5, 1.5, 2.5]
    assert found["material"]["color"].tolist() == [[2.0, 4.0, 6.0]] * 3
    assert found["solid"].tolist() == [True, False, True]


def test_transforms(native_device):
    rng = np.random.default_rng(0)
    values = rng.normal(size=(2, 5, 7))
    values[..., 3:] /= np.linalg.norm(values[..., 3:], axis=-1, keepdims=True)
    a, b = (wp.array(one, dtype=wp.transformd) for one in values)
    out = wp.zeros(5, dtype=wp.transformd)
    wp.launch(all_between, 5, [a, b, out])
    expected = [
        np.array(wp.transform_multiply(wp.transformd(*x), wp.transform_inverse(wp.transformd(*y))))
        for x, y in zip(*values, strict=True)
    ]
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-13, atol=1e-14)


def test_gradients_of_a_struct(native_device):
    materials = []
    for i in range(2):
        m = Material()
        m.density, m.color, m.layers = 0.5 + i, wp.vec3(1.0, 2.0, -1.0 - i), 1
        materials.append(m)
    array = wp.array(materials, dtype=Material, requires_grad=True)
    s = wp.array([3.0, 4.0], dtype=float, requires_grad=True)
    out = wp.zeros(2, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(shade_all, 2, [array, s, out])
    tape.backward(grads={out: wp.array([1.0, 2.0], dtype=float)})
    color = np.array([[1.0, 2.0, -1.0], [1.0, 2.0, -2.0]])
    square, density, seed = np.sum(color**2, axis=1), np.array([0.5, 1.5]), np.array([1.0, 2.0])
    np.testing.assert_allclose(out.numpy(), density * square * [3.0, 4.0], rtol=1e-6)
    np.testing.assert_allclose(s.grad.numpy(), seed * density * square, rtol=1e-6)
    found = array.grad.numpy()
    np.testing.assert_allclose(found["density"], seed * square * [3.0, 4.0], rtol=1e-6)
    scale = 2.0 * seed * density * np.array([3.0, 4.0])
    np.testing.assert_allclose(found["color"], color * scale[:, None], rtol=1e-6)


def test_gradients_of_an_array_in_a_struct(native_device):
    s = Signal()
    s.samples = wp.array([3.0, 4.0], dtype=float, requires_grad=True)
    gain = wp.array([5.0, 6.0], dtype=float, requires_grad=True)
    out = wp.zeros(2, dtype=float, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(amplify_all, 2, [s, gain, out])
    tape.backward(grads={out: wp.array([1.0, 2.0], dtype=float)})
    assert out.numpy().tolist() == [15.0, 24.0]
    assert gain.grad.numpy().tolist() == [3.0, 8.0]
    assert s.samples.grad.numpy().tolist() == [5.0, 12.0]
