"""Vectors, matrices, quaternions, structs and scalar math, against NumPy in double precision."""

import math

import numpy as np
import pytest

import warp as wp

RNG = np.random.default_rng(11)


def launch(kernel, device, n, inputs, *outputs):
    """Launch with NumPy inputs given as (array, dtype); NumPy outputs of the given dtypes."""
    arguments = [
        wp.array(x[0], dtype=x[1], device=device) if isinstance(x, tuple) else x for x in inputs
    ]
    results = [wp.zeros(n, dtype=dtype, device=device) for dtype in outputs]
    wp.launch(kernel, n, arguments, results, device=device)
    return [result.numpy() for result in results]


PRECISIONS = [(wp.float32, np.float32, 4e-6), (wp.float64, np.float64, 1e-13)]


@pytest.mark.parametrize("real, numpy_type, tolerance", PRECISIONS)
def test_vector_algebra(device, real, numpy_type, tolerance):
    vec3 = wp.types.vector(3, real)

    @wp.kernel
    def kernel(
        a: wp.array(dtype=vec3),
        b: wp.array(dtype=vec3),
        v: wp.array(dtype=vec3),
        s: wp.array(dtype=real),
    ):
        i = wp.tid()
        p = a[i]
        q = b[i]
        c = wp.cross(p, q)
        v[i] = c * real(2.0) - p / wp.length(q) + wp.cw_mul(p, q) - wp.normalize(q)
        s[i] = wp.dot(p, c + q) + p[0] * q.z + wp.length_sq(p) + wp.min(p) + wp.max(wp.abs(q))

    a, b = (RNG.normal(size=(50, 3)).astype(numpy_type) for _ in range(2))
    v, s = launch(kernel, device, 50, [(a, vec3), (b, vec3)], vec3, real)
    a, b = a.astype(np.float64), b.astype(np.float64)
    c, length = np.cross(a, b), np.linalg.norm(b, axis=1, keepdims=True)
    np.testing.assert_allclose(v, 2 * c - a / length + a * b - b / length, atol=10 * tolerance)
    dots = ((c + b) * a).sum(1) + a[:, 0] * b[:, 2] + (a * a).sum(1) + a.min(1)
    np.testing.assert_allclose(s, dots + np.abs(b).max(1), atol=20 * tolerance)


@pytest.mark.parametrize("real, numpy_type, tolerance", PRECISIONS)
@pytest.mark.parametrize("n", [2, 3, 4])
def test_square_matrices(device, n, real, numpy_type, tolerance):
    mat, vec = wp.types.matrix((n, n), real), wp.types.vector(n, real)

    @wp.kernel
    def kernel(
        a: wp.array(dtype=mat),
        b: wp.array(dtype=mat),
        v: wp.array(dtype=vec),
        inv: wp.array(dtype=mat),
        prod: wp.array(dtype=mat),
        mv: wp.array(dtype=vec),
        det: wp.array(dtype=real),
    ):
        i = wp.tid()
        inv[i] = wp.inverse(a[i])
        prod[i] = a[i] * wp.transpose(b[i]) + wp.diag(v[i]) - wp.outer(v[i], v[i])
        mv[i] = a[i] * v[i] + b[i][1] - wp.get_diag(a[i])
        det[i] = wp.determinant(a[i]) + wp.trace(b[i])

    a = (RNG.normal(size=(40, n, n)) + 3 * np.eye(n)).astype(numpy_type)
    b = RNG.normal(size=(40, n, n)).astype(numpy_type)
    v = RNG.normal(size=(40, n)).astype(numpy_type)
    inv, prod, mv, det = launch(
        kernel, device, 40, [(a, mat), (b, mat), (v, vec)], mat, mat, vec, real
    )
    a, b, v = (x.astype(np.float64) for x in (a, b, v))
    scale = np.linalg.cond(a).max() * 10
    np.testing.assert_allclose(inv, np.linalg.inv(a), atol=tolerance * scale)
    eye = np.eye(n)
    expected = a @ b.transpose(0, 2, 1) + v[:, :, None] * eye - v[:, :, None] * v[:, None, :]
    np.testing.assert_allclose(prod, expected, atol=20 * tolerance)
    expected = np.einsum("nij,nj->ni", a, v) + b[:, 1] - np.einsum("nii->ni", a)
    np.testing.assert_allclose(mv, expected, atol=20 * tolerance)
    expected = np.linalg.det(a) + np.trace(b, axis1=1, axis2=2)
    np.testing.assert_allclose(det, expected, rtol=20 * tolerance, atol=500 * tolerance)


def test_rectangular_and_large_matrices(device):
    mat23 = wp.types.matrix((2, 3), wp.float32)
    mat34 = wp.types.matrix((3, 4), wp.float32)
    mat24 = wp.types.matrix((2, 4), wp.float32)
    vec7 = wp.types.vector(7, wp.float32)

    @wp.kernel
    def kernel(
        a: wp.array(dtype=mat23),
        b: wp.array(dtype=mat34),
        v: wp.array(dtype=vec7),
        out: wp.array(dtype=mat24),
        w: wp.array(dtype=vec7),
    ):
        i = wp.tid()
        out[i] = a[i] * b[i]
        t = v[i]
        s = vec7()
        for k in range(7):
            s[k] = t[6 - k] * 2.0
        w[i] = s

    a, b, v = (RNG.normal(size=(9, *s)).astype(np.float32) for s in [(2, 3), (3, 4), (7,)])
    out, w = launch(kernel, device, 9, [(a, mat23), (b, mat34), (v, vec7)], mat24, vec7)
    np.testing.assert_allclose(out, a.astype(np.float64) @ b, atol=1e-6)
    np.testing.assert_array_equal(w, 2.0 * v[:, ::-1])


def test_component_assignment_and_dynamic_index(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=wp.vec4), out: wp.array(dtype=wp.mat22)):
        i = wp.tid()
        v = x[i]
        v.x = v.y * 2.0
        v[3] += 1.0
        v[i % 4] = -v[(i + 1) % 4]
        m = wp.mat22(0.0, 0.0, 0.0, 0.0)
        m[0] = wp.vec2(v[0], v[1])
        m[1, 0] = v[2]
        m[1, 1] = v.w
        out[i] = m

    x = RNG.normal(size=(12, 4)).astype(np.float32)
    (out,) = launch(kernel, device, 12, [(x, wp.vec4)], wp.mat22)
    expected = x.copy()
    for i, v in enumerate(expected):
        v[0] = v[1] * np.float32(2.0)
        v[3] += np.float32(1.0)
        v[i % 4] = -v[(i + 1) % 4]
    np.testing.assert_array_equal(out.reshape(12, 4), expected)


def test_assignment_copies_values(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        a = wp.vec3(1.0, 2.0, 3.0)
        b = a
        b[0] = 10.0
        out[0] = a[0]
        out[1] = b[0]

    assert launch(kernel, device, 2, [], float)[0].tolist() == [1.0, 10.0]


def test_quaternion_rotation(device):
    @wp.kernel
    def kernel(
        axis: wp.array(dtype=wp.vec3),
        angle: wp.array(dtype=float),
        v: wp.array(dtype=wp.vec3),
        rotated: wp.array(dtype=wp.vec3),
        by_matrix: wp.array(dtype=wp.vec3),
        back: wp.array(dtype=wp.vec3),
        twice: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        q = wp.quat_from_axis_angle(wp.normalize(axis[i]), angle[i])
        rotated[i] = wp.quat_rotate(q, v[i])
        by_matrix[i] = wp.quat_to_matrix(q) * v[i]
        back[i] = wp.quat_rotate(wp.quat_inverse(q), rotated[i])
        twice[i] = wp.quat_rotate(q * q, v[i])

    axis, v = (RNG.normal(size=(30, 3)).astype(np.float32) for _ in range(2))
    angle = RNG.uniform(-3, 3, 30).astype(np.float32)
    results = launch(
        kernel, device, 30, [(axis, wp.vec3), (angle, float), (v, wp.vec3)], *[wp.vec3] * 4
    )

    def rotate(u, vector, a):
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        c, s = np.cos(a)[:, None], np.sin(a)[:, None]
        along = (u * vector).sum(1, keepdims=True) * u
        return vector * c + np.cross(u, vector) * s + along * (1 - c)

    u, w, a = axis.astype(np.float64), v.astype(np.float64), angle.astype(np.float64)
    once = rotate(u, w, a)
    for result, expected in zip(results, (once, once, w, rotate(u, w, 2 * a))):
        np.testing.assert_allclose(result, expected, atol=5e-6)


def test_transforms(device):
    @wp.kernel
    def kernel(v: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        q = wp.quat_from_axis_angle(wp.vec3(0.0, 0.0, 1.0), 0.5)
        t = wp.transform(wp.vec3(1.0, 2.0, 3.0), q)
        out[i] = wp.transform_point(t * wp.transform_inverse(t) * t, v[i])

    v = RNG.normal(size=(5, 3)).astype(np.float32)
    (out,) = launch(kernel, device, 5, [(v, wp.vec3)], wp.vec3)
    c, s = math.cos(0.5), math.sin(0.5)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(out, v @ rotation.T + [1, 2, 3], atol=3e-6)


@wp.struct
class Body:
    mass: float
    position: wp.vec3
    count: wp.int64
    active: wp.bool
    pose: wp.mat22


@wp.struct
class Scene:
    body: Body
    weights: wp.array(dtype=float)
    gain: wp.float64


def test_struct_argument_with_array_and_nested_struct(device):
    @wp.kernel
    def kernel(scene: Scene, out: wp.array(dtype=float)):
        i = wp.tid()
        b = scene.body
        b.mass = b.mass + 1.0
        if scene.body.active:
            out[i] = b.mass * scene.weights[i] + scene.body.position.y + float(scene.gain)
        out[i] += float(b.count) + b.pose[1, 0]

    scene = Scene()
    scene.body.mass, scene.body.count, scene.body.active = 2.0, 40, True
    scene.body.position = wp.vec3(0.0, 0.5, 0.0)
    scene.body.pose = wp.mat22(1.0, 2.0, 3.0, 4.0)
    scene.gain = 0.25
    scene.weights = wp.array([1.0, 2.0, 3.0], dtype=float, device=device)
    (out,) = launch(kernel, device, 3, [scene], float)
    assert out.tolist() == [3.0 * w + 0.75 + 43.0 for w in (1, 2, 3)]


def test_array_of_structs(device):
    @wp.kernel
    def kernel(bodies: wp.array(dtype=Body)):
        i = wp.tid()
        b = bodies[i]
        b.mass *= 2.0
        b.position[1] = float(i)
        b.count += wp.int64(5)
        b.active = not b.active
        bodies[i] = b
        bodies[i].pose[0, 1] = 9.0

    data = np.zeros(6, dtype=Body.numpy_dtype())
    data["mass"], data["count"] = np.arange(6), 2**40
    bodies = wp.array(data, dtype=Body, device=device)
    wp.launch(kernel, 6, [bodies], device=device)
    result = bodies.numpy()
    assert result["mass"].tolist() == [0, 2, 4, 6, 8, 10]
    assert result["position"][:, 1].tolist() == list(range(6))
    assert (result["count"] == 2**40 + 5).all() and result["active"].all()
    assert (result["pose"][:, 0, 1] == 9.0).all()


def test_struct_constructed_and_returned_by_a_function(device):
    @wp.func
    def make(i: int):
        b = Body()
        b.mass = float(i) * 0.5
        b.position = wp.vec3(1.0, float(i), 2.0)
        return b

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        i = wp.tid()
        b = make(i)
        out[i] = b.mass + b.position.y + float(b.count)

    assert launch(kernel, device, 4, [], float)[0].tolist() == [0.0, 1.5, 3.0, 4.5]


MATH = [
    ("sin", np.sin, -10, 10),
    ("cos", np.cos, -10, 10),
    ("tan", np.tan, -1.4, 1.4),
    ("asin", np.arcsin, -1, 1),
    ("acos", np.arccos, -1, 1),
    ("atan", np.arctan, -20, 20),
    ("sinh", np.sinh, -5, 5),
    ("cosh", np.cosh, -5, 5),
    ("tanh", np.tanh, -5, 5),
    ("exp", np.exp, -20, 20),
    ("log", np.log, 1e-3, 1e3),
    ("log2", np.log2, 1e-3, 1e3),
    ("log10", np.log10, 1e-3, 1e3),
    ("sqrt", np.sqrt, 0, 1e3),
    ("cbrt", np.cbrt, -1e3, 1e3),
    ("abs", np.abs, -5, 5),
    ("floor", np.floor, -5, 5),
    ("ceil", np.ceil, -5, 5),
    ("trunc", np.trunc, -5, 5),
    ("rint", np.rint, -5, 5),
    ("degrees", np.degrees, -5, 5),
    ("radians", np.radians, -500, 500),
    ("frac", lambda x: x - np.trunc(x), -5, 5),
    ("round", lambda x: np.trunc(x + np.copysign(0.5, x)), -5, 5),
    ("erf", np.vectorize(math.erf), -3, 3),
    ("erfc", np.vectorize(math.erfc), -3, 3),
]


@pytest.mark.parametrize("real, numpy_type, tolerance", PRECISIONS)
@pytest.mark.parametrize("name, reference, low, high", MATH, ids=[m[0] for m in MATH])
def test_scalar_math(device, name, reference, low, high, real, numpy_type, tolerance):
    builtin = getattr(wp, name)

    @wp.kernel
    def kernel(x: wp.array(dtype=real), out: wp.array(dtype=real)):
        i = wp.tid()
        out[i] = builtin(x[i])

    x = np.linspace(low, high, 501).astype(numpy_type)
    (out,) = launch(kernel, device, len(x), [(x, real)], real)
    expected = reference(x.astype(np.float64))
    np.testing.assert_allclose(out, expected, rtol=tolerance / 4, atol=tolerance / 16)


def test_two_argument_math(device):
    @wp.kernel
    def kernel(a: wp.array(dtype=float), b: wp.array(dtype=float), out: wp.array(dtype=wp.vec4)):
        i = wp.tid()
        x = a[i]
        y = b[i]
        out[i] = wp.vec4(wp.atan2(x, y), wp.pow(wp.abs(x), y), wp.min(x, y), wp.clamp(x, -0.5, 0.5))

    a, b = (RNG.normal(size=200).astype(np.float32) for _ in range(2))
    (out,) = launch(kernel, device, 200, [(a, float), (b, float)], wp.vec4)
    x, y = a.astype(np.float64), b.astype(np.float64)
    expected = np.stack([np.arctan2(x, y), np.abs(x) ** y, np.minimum(x, y), x.clip(-0.5, 0.5)], 1)
    np.testing.assert_allclose(out, expected, rtol=2e-6, atol=1e-7)


def test_conversions(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        i = wp.tid()
        a = wp.float64(int(x[i])) + wp.float64(wp.float16(x[i])) * wp.float64(100.0)
        b = wp.float64(wp.uint8(int(x[i]) & 255)) + wp.float64(bool(x[i])) * wp.float64(1000.0)
        out[i] = a + b

    x = np.array([0.0, 1.75, -2.75, 100.5, 3.1])
    (out,) = launch(kernel, device, 5, [(x, wp.float64)], wp.float64)
    whole = np.trunc(x)
    half = x.astype(np.float16).astype(np.float64)
    expected = whole + half * 100 + (whole.astype(np.int64) & 255) + (x != 0) * 1000
    np.testing.assert_array_equal(out, expected)


def test_explicit_conversions_of_literals(device):
    @wp.kernel
    def kernel(out: wp.array(dtype=wp.float64)):
        if wp.tid() > 0:
            return
        out[0] = wp.float64(wp.uint32(-1))
        out[1] = wp.float64(wp.uint8(-2))
        out[2] = wp.float64(wp.int(2.75)) + wp.float64(wp.float(3))
        out[3] = wp.float64(0.1)

    (out,) = launch(kernel, device, 4, [], wp.float64)
    assert out.tolist() == [2.0**32 - 1, 254.0, 5.0, 0.1]


def test_conversion_to_half_precision_rounds(device):
    @wp.kernel
    def kernel(x: wp.array(dtype=float), h: wp.array(dtype=wp.float16), out: wp.array(dtype=int)):
        i = wp.tid()
        if wp.float16(x[i]) == h[i]:
            out[i] = 1

    x = RNG.normal(size=200).astype(np.float32)
    (out,) = launch(kernel, device, 200, [(x, float), (x.astype(np.float16), wp.float16)], int)
    assert out.all()
