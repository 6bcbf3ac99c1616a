"""Small numbers beside large ones: what the generated search of reports has found."""

import mpmath as mp
import numpy as np
import pytest

import warp as wp


def symmetric_logarithm(a):
    values, vectors = mp.eigsy(mp.matrix(a.tolist()))
    return vectors * mp.diag([mp.log(x) for x in values]) * vectors.T


@pytest.mark.parametrize(("dtype", "bound"), [(wp.float32, 1e-6), (wp.float64, 1e-14)])
@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-8, 1e-12, 1e-25])
def test_logarithm_near_the_identity(device, dtype, bound, size):
    mat = wp.types.matrix((3, 3), dtype)

    @wp.kernel
    def logarithm(a: wp.array(dtype=mat), y: wp.array(dtype=mat)):
        y[0] = wp.sym_log3(a[0])

    noise = np.random.default_rng(3).normal(size=(3, 3)) * size
    given = np.eye(3) + noise + noise.T
    a = wp.array(given[None], dtype=mat, device=device)
    off = ~np.eye(3, dtype=bool)
    held = a.numpy()[0].astype(np.float64)
    held[off] = given.astype(a.numpy().dtype)[off]
    y = wp.zeros(1, dtype=mat, device=device)
    # np.eye(3) + noise has lost the small entries in float64 only on the diagonal.
    wp.launch(logarithm, 1, [a, y], device=device)
    with mp.workdps(80):
        exact = symmetric_logarithm(held)
        error = max(
            abs(mp.mpf(float(y.numpy()[0][i, j])) - exact[i, j]) for i, j in np.ndindex(3, 3)
        )
        largest = max(abs(x) for x in exact)
    assert largest > 0 and error <= bound * largest


@pytest.mark.parametrize(("dtype", "bound"), [(wp.float32, 3e-3), (wp.float64, 3e-7)])
def test_gradient_of_the_determinant_of_nearly_dependent_rows(device, dtype, bound):
    """Cofactors are of the square of the distance from rank one, their terms of the distance.

    The rows are dependent but for powers of two, so that all of them are exact.
    """
    mat = wp.types.matrix((4, 4), dtype)
    step = 2.0**-13 if dtype is wp.float32 else 2.0**-30

    @wp.kernel
    def volume(a: wp.array(dtype=mat), y: wp.array(dtype=dtype)):
        y[0] = wp.determinant(a[0])

    rows = np.outer([1.0, 2.0, 0.5, 4.0], [1.0, 1.0, 1.0, 1.0])
    change = np.random.default_rng(5).integers(-8, 9, size=(4, 4))
    a = wp.array((rows + step * change)[None], dtype=mat, requires_grad=True, device=device)
    y = wp.zeros(1, dtype=dtype, requires_grad=True, device=device)
    with wp.Tape() as tape:
        wp.launch(volume, 1, [a, y], device=device)
    tape.backward(y)
    with mp.workdps(60):
        held = mp.matrix(a.numpy()[0].tolist())
        exact = (mp.det(held) * mp.inverse(held)).T
        found = mp.matrix(a.grad.numpy()[0].tolist())
        largest = max(abs(x) for x in exact)
        error = max(abs(x) for x in exact - found)
    assert error <= bound * largest


@pytest.mark.parametrize(("dtype", "bound"), [(wp.float32, 1e-6), (wp.float64, 1e-14)])
@pytest.mark.parametrize("pitch", [1e-8, 1e-3, 1.0, np.pi / 2 - 1e-3])
def test_pitch_of_small_and_right_angles(device, dtype, bound, pitch):
    quat = wp.types.quaternion(dtype)

    @wp.kernel
    def angles(q: wp.array(dtype=quat), y: wp.array(dtype=wp.types.vector(3, dtype))):
        y[0] = wp.quat_to_rpy(q[0])

    q = wp.array([[0.0, np.sin(pitch / 2), 0.0, np.cos(pitch / 2)]], dtype=quat, device=device)
    y = wp.zeros(1, dtype=wp.types.vector(3, dtype), device=device)
    wp.launch(angles, 1, [q, y], device=device)
    _, b, _, d = (mp.mpf(float(x)) for x in q.numpy()[0])
    exact = 2 * mp.atan2(b, d)
    assert abs(mp.mpf(float(y.numpy()[0][1])) - exact) <= bound * exact
