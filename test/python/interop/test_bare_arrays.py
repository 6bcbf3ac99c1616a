"""`return_ctype=True`: launches take the memory of a tensor as their parameters say."""

import numpy as np
import pytest

import warp as wp

torch = pytest.importorskip("torch")


def import_paddle():
    return pytest.importorskip("paddle")


def of_torch(data, dtype=None, **options):
    t = torch.tensor(data)
    return t, wp.from_torch(t, dtype, return_ctype=True, **options)


def of_paddle(data, dtype=None, **options):
    t = import_paddle().to_tensor(data, place="cpu")
    return t, wp.from_paddle(t, dtype, return_ctype=True, **options)


@pytest.fixture(params=[of_torch, of_paddle], ids=["torch", "paddle"])
def make(request):
    return request.param


@wp.kernel
def count(out: wp.array(dtype=wp.int32), n: int):
    for i in range(n):
        out[i] = i + 1


@wp.kernel
def double_rows(x: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    x[i] = 2.0 * x[i]


@wp.kernel
def add_indices(x: wp.array2d(dtype=float)):
    i, j = wp.tid()
    x[i, j] = x[i, j] + float(10 * i + j)


@wp.kernel
def extents(x: wp.array3d(dtype=float), found: wp.array(dtype=int)):
    for axis in range(3):
        found[axis] = x.shape[axis]
    x[1, 0, 0] = 7.0


def test_composite_for_numbers(make):
    """A single vec3i taken for int32 numbers, as nvalchemi passes one."""
    t, a = make(np.zeros(3, np.int32), wp.vec3i)
    wp.launch(count, 1, [a, 3], device="cpu")
    assert t.tolist() == [1, 2, 3]


def test_numbers_for_composites(make):
    t, a = make(np.arange(6, dtype=np.float32).reshape(2, 3))
    wp.launch(double_rows, 2, [a], device="cpu")
    assert t.tolist() == [[0.0, 2.0, 4.0], [6.0, 8.0, 10.0]]


def test_other_numbers(make):
    t, a = make(np.zeros(2, np.float32))
    wp.launch(count, 1, [a, 2], device="cpu")
    assert t.numpy().view(np.int32).tolist() == [1, 2]


def test_more_dimensions(make):
    """The first dimensions are those of the parameter, with their strides."""
    t, a = make(np.zeros((2, 2, 3), np.float32))
    wp.launch(add_indices, (2, 2), [a], device="cpu")
    assert t.numpy()[:, :, 0].tolist() == [[0.0, 1.0], [10.0, 11.0]]
    assert not t.numpy()[:, :, 1:].any()


def test_fewer_dimensions(make):
    """Missing dimensions have the extent 1."""
    t, a = make(np.zeros(4, np.float32))
    found = wp.zeros(3, dtype=int, device="cpu")
    wp.launch(extents, 1, [a, found], device="cpu")
    assert found.list() == [4, 1, 1]
    assert t.tolist() == [0.0, 7.0, 0.0, 0.0]


def test_recorded_launch(make):
    t, a = make(np.zeros(3, np.int32), wp.vec3i)
    other, b = make(np.zeros(3, np.int32), wp.vec3i)
    made = wp.launch(count, 1, [a, 3], device="cpu", record_cmd=True)
    made.launch()
    made.set_param_at_index(0, b)
    made.launch()
    assert t.tolist() == other.tolist() == [1, 2, 3]


def test_strides_and_gradients(make):
    """It is an array in all else, which keeps memory alive and has the tensor's gradient."""
    t, a = make(np.arange(12, dtype=np.float32).reshape(4, 3), wp.vec3, requires_grad=True)
    assert (a.shape, a.dtype) == ((4,), wp.vec3)
    assert a.grad.shape == (4,) and not a.grad.numpy().any()
    x = torch.arange(12.0).reshape(2, 6)
    wp.launch(add_indices, (2, 3), [wp.from_torch(x[:, ::2], return_ctype=True)], device="cpu")
    assert x[1].tolist() == [16.0, 7.0, 19.0, 9.0, 22.0, 11.0]


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@pytest.mark.parametrize("taped", [False, True])
def test_derivatives(make, taped):
    """Gradients are taken as the arrays are: here the first number of each row."""
    _, a = make(np.arange(6, dtype=np.float32).reshape(2, 3), wp.vec3, requires_grad=True)
    found, g = make(np.zeros((2, 3), np.float32), wp.vec3)
    y, seed = (wp.ones(2, dtype=float, device="cpu", requires_grad=one) for one in (True, False))
    if taped:
        with wp.Tape() as tape:
            wp.launch(square, 2, [a, y], device="cpu")
        tape.backward(grads={y: seed})
        found = a.grad
    else:
        named = {"adj_inputs": [g], "adj_outputs": [seed]}
        wp.launch(square, 2, [a], [y], adjoint=True, device="cpu", **named)
    assert found.numpy().tolist() == [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0]]


def test_without_it_types_are_checked():
    t = torch.zeros(3, dtype=torch.int32)
    with pytest.raises(TypeError, match="argument 'out' expects"):
        wp.launch(count, 1, [wp.from_torch(t, wp.vec3i), 3], device="cpu")


def test_device_is_checked(make):
    """An array that cannot be reached is an error as ever."""
    if not wp.get_cuda_device_count():
        pytest.skip("no CUDA device")
    _, a = make(np.zeros(3, np.int32), wp.vec3i)
    with pytest.raises(TypeError, match="the launch is on 'cuda:0'"):
        wp.launch(count, 1, [a, 3], device="cuda:0")
