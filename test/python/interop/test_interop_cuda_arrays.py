"""The CUDA array interface: CuPy, Numba, and objects that have nothing else."""

import gc

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.cuda


@wp.kernel
def scale(x: wp.array(dtype=float), s: float):
    i = wp.tid()
    x[i] = x[i] * s


@wp.kernel
def shift(x: wp.array(dtype=wp.vec3), by: float):
    i = wp.tid()
    x[i] = x[i] + wp.vec3(by)


@wp.kernel
def slow(x: wp.array(dtype=float)):
    i = wp.tid()
    value = float(0.0)
    for _ in range(100000):
        value = wp.sin(value + 1.0)
    x[i] = wp.where(value > 5.0, value, 1.0)


class Foreign:
    """Another library's array: only the interface."""

    def __init__(self, array, **changes):
        self.array = array
        self.changes = changes

    @property
    def __cuda_array_interface__(self):
        return {**self.array.__cuda_array_interface__, **self.changes}


@pytest.fixture
def cupy():
    return pytest.importorskip("cupy")


@pytest.fixture
def cuda():
    numba = pytest.importorskip("numba.cuda")
    if not numba.is_available():
        pytest.skip("Numba without CUDA")
    return numba


def test_interface():
    a = wp.zeros((4, 6), dtype=wp.vec3, device="cuda:0")[::2]
    found = a.__cuda_array_interface__
    assert found["version"] == 3
    assert found["shape"] == (2, 6, 3)
    assert found["strides"] == (144, 12, 4)
    assert found["data"] == (a.ptr, False)
    assert found["stream"] == wp.get_stream("cuda:0").cuda_stream
    assert not hasattr(a, "__array_interface__")
    with pytest.raises(AttributeError, match="on 'cpu'"):
        wp.zeros(3, device="cpu").__cuda_array_interface__  # noqa: B018


def test_array_from_interface():
    numbers = np.arange(12, dtype=np.float32).reshape(4, 3)
    source = wp.array(numbers, dtype=float, device="cuda:0")
    shared = wp.array(Foreign(source), dtype=wp.vec3, copy=False)
    assert (shared.ptr, shared.shape, str(shared.device)) == (source.ptr, (4,), "cuda:0")
    copied = wp.array(Foreign(source), dtype=wp.vec3)
    source.zero_()
    assert not shared.numpy().any()
    np.testing.assert_array_equal(copied.numpy(), numbers)
    assert wp.array(Foreign(copied), device="cpu").list() == list(range(12))
    converted = wp.array(Foreign(copied), dtype=wp.vec3d)
    np.testing.assert_array_equal(converted.numpy(), numbers.astype(np.float64))


def test_strides_and_read_only():
    source = wp.array(np.arange(12.0), dtype=wp.float64, device="cuda:0")[::3]
    shared = wp.array(Foreign(source, data=(source.ptr, True)), copy=False)
    assert shared.strides == (24,)
    assert shared.list() == [0.0, 3.0, 6.0, 9.0]
    with pytest.raises(ValueError, match="read-only"):
        shared.zero_()
    with pytest.raises(TypeError, match="mask"):
        wp.array(Foreign(source, mask=source))


def test_structs():
    @wp.struct
    class Pair:
        a: float
        b: wp.int32

    source = wp.zeros(3, dtype=Pair, device="cuda:0")
    shared = wp.array(Foreign(source), dtype=Pair, copy=False)
    assert (shared.ptr, shared.dtype) == (source.ptr, Pair)


# Writes of another stream are complete before the read.
@pytest.mark.parametrize("way", ["array", "launch", "launch on a stream"])
def test_writer_stream(way):
    writer = wp.Stream("cuda:0")
    a = wp.zeros(64, device="cuda:0")
    wp.synchronize()
    wp.launch(slow, dim=64, inputs=[a], stream=writer)
    foreign = Foreign(a, stream=writer.cuda_stream)
    if way == "array":
        shared = wp.array(foreign, copy=False)
        wp.launch(scale, dim=64, inputs=[shared, 3.0], device="cuda:0")
    elif way == "launch":
        wp.launch(scale, dim=64, inputs=[foreign, 3.0], device="cuda:0")
    else:
        reader = wp.Stream("cuda:0")
        wp.launch(scale, dim=64, inputs=[foreign, 3.0], stream=reader)
        reader.synchronize()
    assert a.list() == [3.0] * 64


def test_to_cupy(cupy):
    a = wp.array(np.arange(12.0), dtype=wp.float32, device="cuda:0").reshape((4, 3))
    for make in (cupy.asarray, cupy.from_dlpack):
        c = make(a)
        assert (c.data.ptr, c.shape, c.dtype) == (a.ptr, (4, 3), cupy.float32)
    assert cupy.asarray(a.transpose()).strides == (4, 12)
    assert cupy.asarray(wp.zeros(5, dtype=wp.mat22, device="cuda:0")).shape == (5, 2, 2)
    c = cupy.asarray(wp.full(8, 2.0, device="cuda:0"))
    gc.collect()
    assert float(c.sum()) == 16.0


def test_from_cupy(cupy):
    c = cupy.arange(12, dtype=cupy.float32).reshape(4, 3)
    for a in (wp.from_dlpack(c, dtype=wp.vec3), wp.array(c, dtype=wp.vec3, copy=False)):
        assert (a.ptr, a.shape) == (c.data.ptr, (4,))
    wp.launch(shift, dim=4, inputs=[a, 1.0], device="cuda:0")
    wp.launch(shift, dim=4, inputs=[c, 1.0], device="cuda:0")
    assert cupy.array_equal(c, cupy.arange(12, dtype=cupy.float32).reshape(4, 3) + 2)
    assert wp.array(c.astype(cupy.int64)).dtype is wp.int64


# CuPy's stream and ours alternate on one array.
def test_cupy_streams(cupy):
    side = cupy.cuda.Stream(non_blocking=True)
    with side:
        c = cupy.zeros(1 << 20, dtype=cupy.float32)
        for _ in range(10):
            c += 1.0
            a = wp.from_dlpack(c)
            wp.launch(scale, dim=a.size, inputs=[a, 2.0], device="cuda:0")
            c = cupy.from_dlpack(a)
        assert bool((c == 2.0**11 - 2).all())


def test_numba_arrays(cuda):
    a = wp.full(100, 2.0, device="cuda:0")
    assert cuda.as_cuda_array(a).copy_to_host().tolist() == [2.0] * 100
    n = cuda.to_device(np.ones(10, np.float32))
    wp.launch(scale, dim=10, inputs=[n, 5.0], device="cuda:0")
    b = wp.array(n, copy=False)
    wp.launch(scale, dim=10, inputs=[b, 2.0], device="cuda:0")
    wp.synchronize()
    assert n.copy_to_host().tolist() == [10.0] * 10


def test_numba_kernels(cuda):
    @cuda.jit
    def add_one(x):
        i = cuda.grid(1)
        if i < x.size:
            x[i] += 1.0

    try:
        add_one[1, 32](cuda.to_device(np.ones(10, np.float32)))
    except AttributeError as error:
        pytest.skip(f"this Numba does not run: {error}")
    a = wp.zeros(100, dtype=float, device="cuda:0")
    add_one[1, 128](a)
    add_one[1, 128](cuda.as_cuda_array(a))
    cuda.synchronize()
    assert a.list() == [2.0] * 100
