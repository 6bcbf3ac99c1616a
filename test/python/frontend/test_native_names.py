"""Names of namespace `wp` that native functions find, against NumPy and the kernel language."""

import numpy as np

import warp as wp

R = wp.float64


@wp.func_native("""
    using namespace wp;
    vec_t<3, float64> a(x, 2.0, -3.0), b(1.0, x, 4.0);
    mat_t<3, 3, float64> m(1.0, 2.0, 3.0, 0.0, x, 4.0, 5.0, 6.0, 1.0);
    quat_t<float64> q = wp::quat_from_axis_angle(a, x), p(0.1, 0.2, 0.3, x);
    mat_t<2, 3, float64> w(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
    int k = 0;
    float64 found[] = {
        wp::dot(a, b), wp::length(a), wp::length_sq(wp::sub(a, b)), wp::cross(a, b)[1],
        wp::normalize(wp::add(a, b))[2], wp::cw_mul(a, b)[2], wp::mul(2.0, a)[1],
        wp::min(a, b)[1], wp::max(a), float64(wp::argmin(a)), wp::abs(a)[2], wp::neg(a)[0],
        wp::lerp(a, b, 0.25)[0], wp::mul(m, a)[2], wp::mul(a, m)[1], wp::mul(m, m)[0][2],
        wp::transpose(w)[2][1], wp::determinant(m), wp::inverse(m)[1][2], wp::trace(m),
        wp::ddot(m, m), wp::outer(a, b)(1, 2), wp::mul(w, b)[1], wp::skew(a)[0][1],
        wp::quat_rotate(q, b)[0], wp::quat_rotate_inv(q, b)[1], wp::quat_to_matrix(q)[1][0],
        wp::mul(p, q)[3], wp::quat_inverse(p).x, wp::normalize(p).w, m.get_col(1)[2],
        wp::clamp(x, 1.0, 2.0), wp::sign(-x), wp::step(-x), wp::frac(x + 3.25), wp::pow(x, 2.5),
        wp::atan2(x, 2.0), wp::round(2.5), wp::rint(2.5), wp::mod(-7.5, 2.0), wp::degrees(x),
        wp::smoothstep(0.0, 1.0, x), wp::log1p(x), wp::cbrt(-8.0), float64(wp::isfinite(x / 0.0)),
        float64(wp::isnan(0.0 * (x / 0.0))), float64(wp::isinf(x / 0.0)), wp::where(true, x, 1.0),
        float64(wp::max(int64(3), int64(-5))), float64(wp::abs(-7)), float64(a == a), a[-1],
    };
    for (float64 one : found)
        out.data[k++] = one;
""")
def all_names(x: wp.float64, out: wp.array(dtype=wp.float64)): ...


@wp.kernel(enable_backward=False)
def run_names(x: wp.float64, out: wp.array(dtype=wp.float64)):
    all_names(x, out)


def rotation(axis, angle):
    """Rodrigues' formula."""
    x, y, z = axis / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * (k @ k)


def test_numbers_vectors_matrices_quaternions(native_device):
    x = 0.7
    out = wp.full(60, -99.0, dtype=R)
    wp.launch(run_names, 1, [x], [out])
    a, b = np.array([x, 2.0, -3.0]), np.array([1.0, x, 4.0])
    m = np.array([[1.0, 2.0, 3.0], [0.0, x, 4.0], [5.0, 6.0, 1.0]])
    w = np.arange(1.0, 7.0).reshape(2, 3)
    turn = rotation(a, x)
    sine = np.sin(x / 2.0) * a / np.linalg.norm(a)
    p = np.array([0.1, 0.2, 0.3, x])
    expected = [
        *(a @ b, np.linalg.norm(a), (a - b) @ (a - b), np.cross(a, b)[1]),
        *((a + b)[2] / np.linalg.norm(a + b), -12.0, 4.0, x, 2.0, 2, 3.0, -x),
        *(0.75 * x + 0.25, (m @ a)[2], (a @ m)[1], (m @ m)[0, 2], 6.0, np.linalg.det(m)),
        *(np.linalg.inv(m)[1, 2], np.trace(m), np.sum(m * m), 8.0, (w @ b)[1], 3.0),
        *((turn @ b)[0], (turn.T @ b)[1], turn[1, 0], x * np.cos(x / 2.0) - p[:3] @ sine),
        *(-0.1, x / np.linalg.norm(p), 6.0, 1.0, -1.0, 1.0, x + 3.25 - 3.0, x**2.5),
        *(np.arctan2(x, 2.0), 3.0, 2.0, -1.5, np.degrees(x), x * x * (3.0 - 2.0 * x)),
        *(np.log1p(x), -2.0, 0, 1, 1, x, 3, 7, 1, -3.0),
    ]
    np.testing.assert_allclose(out.numpy()[: len(expected)], expected, rtol=1e-12)
    assert (out.numpy()[len(expected) :] == -99.0).all()


@wp.func_native("""
    struct vec9 { float a; };
    vec9 v{sqrt(x) + abs(-x) + floor(x) + fmin(x, 1.0f)};
    return v.a + isfinite(x) + (isnan(x) ? 1.0f : 0.0f) + round(x) + pow(x, 2.0f);
""")
def names_of_c(x: float) -> float: ...


@wp.kernel(enable_backward=False)
def run_names_of_c(out: wp.array(dtype=float)):
    out[0] = names_of_c(4.0)


def test_names_without_a_namespace_are_those_of_c(native_device):
    out = wp.zeros(1, dtype=float)
    wp.launch(run_names_of_c, 1, [out])
    assert out.numpy()[0] == 2.0 + 4.0 + 4.0 + 1.0 + 1.0 + 0.0 + 4.0 + 16.0


@wp.func_native("wp::atomic_exch(last, 0, i); wp::atomic_add(&last.data[1], 2);")
def exchange(i: int, last: wp.array(dtype=int)): ...


@wp.kernel(enable_backward=False)
def run_updates(
    sum: wp.array(dtype=float),
    grid: wp.array2d(dtype=int),
    vectors: wp.array(dtype=wp.vec3),
    last: wp.array(dtype=int),
):
    i = wp.tid()
    wp.atomic_add(grid, 1, 2, 0)
    exchange(i, last)
    update_at(i, sum, grid, vectors)


@wp.func_native("""
    float x = float(i) - 3.0f;
    wp::atomic_add(sum, 0, x);
    wp::atomic_min(sum, 1, x);
    wp::atomic_max(wp::address(sum, 2), x);
    wp::atomic_sub(grid, 1, 2, i);
    wp::atomic_or(grid, 0, 1, 1 << (i & 7));
    wp::atomic_add(vectors, 0, wp::vec3(x, 1.0f, -x));
    wp::atomic_cas(&wp::index(grid, 0, 0), i, -1);
""")
def update_at(
    i: int,
    sum: wp.array(dtype=float),
    grid: wp.array2d(dtype=int),
    vectors: wp.array(dtype=wp.vec3),
): ...


def test_atomics(native_device):
    n = 1000
    sums, grid = wp.zeros(3, dtype=float), wp.zeros((2, 3), dtype=int)
    vectors, last = wp.zeros(1, dtype=wp.vec3), wp.zeros(2, dtype=int)
    wp.launch(run_updates, n, [sums, grid, vectors, last])
    total = n * (n - 1) // 2 - 3 * n
    assert sums.numpy().tolist() == [total, -3.0, n - 4.0]
    assert grid.numpy().tolist() == [[-1, 255, 0], [0, 0, -(n * (n - 1)) // 2]]
    assert vectors.numpy().tolist() == [[total, n, -total]]
    assert last.numpy()[1] == 2 * n and 0 <= last.numpy()[0] < n
