"""Programs that only this package runs: `scripts/peer_tests.py` counts them apart."""

import numpy as np
import pytest

import warp as wp


@wp.func
def double(x: float):
    return 2.0 * x


@wp.func
def halve(x: float):
    return 0.5 * x


@wp.func
def increase(x: wp.ref[wp.float32]):
    x += wp.float32(1.0)


@wp.kernel
def other_function(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    f = double
    f = halve
    out[0] = f(x[0])


@wp.kernel
def number_after_function(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    f = double
    f = x[0]
    out[0] = f


@wp.kernel(enable_backward=False)
def numbers_after_gradient(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    g = wp.grad(double)
    g, y = (x[0], 2.0)
    out[0] = g + y


@wp.kernel
def sum_from_a_constant(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i]
    out[0] = total


@wp.kernel(enable_backward=False)
def reference_to_a_constant(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    y = 1.0
    increase(y)
    out[0] = y + x[0]


@pytest.mark.parametrize(
    ("kernel", "expected"),
    [
        (other_function, 1.5),
        (number_after_function, 3.0),
        (numbers_after_gradient, 5.0),
        (sum_from_a_constant, 7.0),
        (reference_to_a_constant, 5.0),
    ],
)
def test_locals_may_become_something_else(device, kernel, expected):
    x = wp.array([3.0, 4.0], dtype=float, device=device)
    out = wp.zeros(1, dtype=float, device=device)
    wp.launch(kernel, 1, [x], [out], device=device)
    assert out.numpy()[0] == expected


@wp.kernel
def through_a_reference(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    t = x[i] * x[i]
    increase(t)
    y[i] = t * x[i]


def test_derivatives_through_references(device):
    x = wp.array([2.0, 3.0], dtype=float, device=device, requires_grad=True)
    y = wp.zeros_like(x)
    with wp.Tape() as tape:
        wp.launch(through_a_reference, 2, [x], [y], device=device)
    tape.backward(grads={y: wp.ones_like(y)})
    np.testing.assert_allclose(y.numpy(), [10.0, 30.0])
    np.testing.assert_allclose(x.grad.numpy(), [13.0, 28.0])


def test_parts_of_indexed_arrays_are_copied(device):
    base = wp.array(np.arange(10, 16), dtype=int, device=device)
    chosen = base[wp.array([0, 2, 4], dtype=int, device=device)]
    dest = wp.zeros(3, dtype=int, device=device)
    wp.copy(dest, chosen, src_offset=1, count=2)
    np.testing.assert_array_equal(dest.numpy(), [12, 14, 0])


@wp.kernel
def converted(pose: wp.array(dtype=wp.transformd), pair: wp.array(dtype=float)):
    pose[0] = wp.transformd(wp.transform(wp.vec3(1.0, 2.0, 3.0), wp.quat_identity()))
    both = wp.types.vector(1.0, 2)
    pair[0] = both[0] + both[1]


def test_constructors_convert(device):
    pose = wp.zeros(1, dtype=wp.transformd, device=device)
    pair = wp.zeros(1, dtype=float, device=device)
    wp.launch(converted, 1, [pose, pair], device=device)
    np.testing.assert_array_equal(pose.numpy()[0], [1, 2, 3, 0, 0, 0, 1])
    assert pair.numpy()[0] == 3.0


@wp.kernel
def by_class(out: wp.array(dtype=float)):
    v = wp.vec(length=3, dtype=float)
    w = wp.vec(5.0, length=2)
    m = wp.mat(shape=(2, 2), dtype=float)
    n = wp.mat(1.0, 2.0, 3.0, 4.0)
    v[1] = 7.0
    m[1, 0] = 8.0
    out[0] = v[0] + v[1] + w[1]
    out[1] = m[1, 0] + m[0, 0] + n[1, 1]


def test_the_classes_of_all_vectors_and_matrices_construct(device):
    out = wp.zeros(2, dtype=float, device=device)
    wp.launch(by_class, 1, [out], device=device)
    assert out.numpy().tolist() == [12.0, 12.0]


@wp.kernel
def named_number(out: wp.array(dtype=float)):
    out[0] = wp.float32(value=2.0)


def test_conversions_refuse_names(device):
    out = wp.zeros(1, dtype=float, device=device)
    with pytest.raises(TypeError, match="'float32' has no parameter 'value'"):
        wp.launch(named_number, 1, [out], device=device)


def test_graphs_of_arrays_with_gaps(device):
    source = wp.array(np.arange(16).reshape(4, 4), dtype=int, device=device)
    dest = wp.zeros((4, 4), dtype=int, device=device)
    odd = wp.indexedarray(
        wp.zeros(6, dtype=int, device=device), [wp.array([1, 3, 5], dtype=int, device=device)]
    )
    with wp.ScopedCapture(device=device) as capture:
        wp.copy(dest[:, 0], source[:, 1])
        dest[:, 2].fill_(7)
        odd.fill_(42)
    for array in (dest, odd.data):
        array.zero_()
    source += 1
    wp.capture_launch(capture.graph)
    expected = np.zeros((4, 4))
    expected[:, 0], expected[:, 2] = np.arange(2, 16, 4), 7
    np.testing.assert_array_equal(dest.numpy(), expected)
    np.testing.assert_array_equal(odd.data.numpy(), [0, 42, 0, 42, 0, 42])
