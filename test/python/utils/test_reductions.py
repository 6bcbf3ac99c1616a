"""Sums, inner products and casts beside NumPy; edges of meshes."""

import numpy as np
import pytest

import warp as wp
import warp.utils


def random(shape, dtype, device):
    values = np.random.default_rng(1).standard_normal(shape)
    return wp.array(values, dtype=dtype, device=device), values


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_whole_arrays(device, dtype):
    for count in (0, 1, 1000, 100_000):
        x, numbers = random(count, dtype, device)
        tolerance = 1e-6 * max(1, count) ** 0.5
        assert abs(wp.utils.array_sum(x) - numbers.sum()) < tolerance
        assert abs(wp.utils.array_inner(x, x) - numbers @ numbers) < max(1, count) * 1e-6
    assert wp.utils.array_sum(x[:4], value_count=2) == pytest.approx(numbers[:2].sum(), rel=1e-6)


def test_sums_of_millions_keep_their_digits(device):
    x = wp.full(3_000_000, 0.1, dtype=wp.float32, device=device)
    exact = 3_000_000 * float(np.float32(0.1))
    assert wp.utils.array_sum(x) == pytest.approx(exact, rel=1e-7)
    assert wp.utils.array_inner(x, x) == pytest.approx(exact * float(np.float32(0.1)), rel=1e-7)
    v = wp.full(1_000_000, wp.vec3(0.1), dtype=wp.vec3, device=device)
    np.testing.assert_allclose(wp.utils.array_sum(v), exact / 3, rtol=1e-7)


def test_gradients_of_sums(device):
    x = wp.array([1.0, 2.0, 3.0], dtype=wp.float32, device=device, requires_grad=True)
    out = wp.zeros(1, dtype=wp.float32, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.utils.array_inner(x, x, out)
    tape.backward(out)
    np.testing.assert_array_equal(x.grad.numpy(), [2.0, 4.0, 6.0])


def test_vectors_and_views(device):
    v, numbers = random((50, 3), wp.vec3d, device)
    np.testing.assert_allclose(wp.utils.array_sum(v), numbers.sum(axis=0))
    assert wp.utils.array_inner(v, v) == pytest.approx((numbers**2).sum())
    x, numbers = random((6, 8), wp.float64, device)
    assert wp.utils.array_sum(x[::2, 1:5]) == pytest.approx(numbers[::2, 1:5].sum())


@pytest.mark.parametrize("axis", [0, 1, 2, -1])
def test_along_an_axis(device, axis):
    x, numbers = random((4, 5, 6), wp.float64, device)
    y = x[::2, :, 1:6:2]
    numbers = numbers[::2, :, 1:6:2]
    result = wp.utils.array_sum(y, axis=axis).numpy()
    np.testing.assert_allclose(result, numbers.sum(axis=axis, keepdims=True))
    result = wp.utils.array_inner(y, y, axis=axis).numpy()
    np.testing.assert_allclose(result, (numbers**2).sum(axis=axis, keepdims=True))


def test_casts(device):
    numbers = np.arange(24).reshape(2, 3, 4) - 7.75
    x = wp.array(numbers, dtype=wp.float64, device=device)
    result = wp.empty((2, 3, 4), dtype=wp.int32, device=device)
    wp.utils.array_cast(x, result)
    np.testing.assert_array_equal(result.numpy(), numbers.astype(int))
    vectors = wp.empty(8, dtype=wp.vec3, device=device)
    wp.utils.array_cast(x, vectors)
    np.testing.assert_array_equal(vectors.numpy().ravel(), numbers.ravel())
    some = wp.zeros(24, dtype=wp.float32, device=device)
    wp.utils.array_cast(x.flatten(), some, count=5)
    np.testing.assert_array_equal(some.numpy(), np.where(np.arange(24) < 5, numbers.ravel(), 0))


@pytest.mark.parametrize("dtype", [wp.float32, wp.float64])
def test_graphs_write_to_arrays(device, dtype):
    x = wp.ones(100, dtype=dtype, device=device)
    out = wp.zeros(1, dtype=dtype, device=device)
    with wp.ScopedCapture(device=device) as capture:
        wp.utils.array_sum(x, out)
        with pytest.raises(NotImplementedError, match="explicit out"):
            wp.utils.array_sum(x)
    x.fill_(3.0)
    wp.capture_launch(capture.graph)
    assert out.numpy()[0] == 300


def test_wrong_arguments(device):
    x = wp.ones(4, dtype=float, device=device)
    for arguments, error, words in (
        ((wp.ones(4, dtype=int, device=device),), RuntimeError, "Unsupported data type: int32"),
        ((x, wp.ones(2, dtype=float, device=device)), RuntimeError, "should have shape"),
        ((x, wp.ones(1, dtype=int, device=device)), RuntimeError, "should have type float32"),
        ((x, None, None, 1), IndexError, "axis 1 is out of bounds"),
        ((x, None, 5), RuntimeError, "0 to 4 elements"),
        ((x, None, -1), RuntimeError, "0 to 4 elements"),
    ):
        with pytest.raises(error, match=words):
            wp.utils.array_sum(*arguments)
    with pytest.raises(ValueError, match="same shape"):
        wp.utils.array_inner(x, x[:2])
    with pytest.raises(RuntimeError, match="exceeds the input size"):
        wp.utils.array_cast(x, wp.ones(3, dtype=int, device=device))


def test_edges_of_triangles(capsys):
    edges = wp.utils.MeshAdjacency([(0, 3, 1), (0, 2, 3)], 2).edges
    shared = edges[0, 3]
    assert (shared.o0, shared.o1, shared.f0, shared.f1) == (1, 2, 0, 1)
    assert len(edges) == 5 and edges[1, 3].f1 == -1
    wp.utils.MeshAdjacency([(0, 3, 1), (0, 2, 3), (3, 0, 1)], 3)
    assert capsys.readouterr().out == "Detected non-manifold edge\n"
