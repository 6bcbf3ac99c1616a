"""PaddlePaddle: tensors and arrays over the same memory; a stand-in takes its place if need be."""

import sys
import types

import numpy as np
import pytest

import warp as wp

try:
    import paddle as installed
except ImportError:
    installed = None


class Tensor:
    """The used part of Paddle's tensors, over NumPy."""

    def __init__(self, data, place="Place(cpu)"):
        self.data, self.place = data, place
        self.stop_gradient, self.grad = True, None

    def _share(self, value):
        self.grad = value

    grad_ = property(lambda self: self.grad, _share)
    dtype = property(lambda self: self.data.dtype.name)
    shape = property(lambda self: list(self.data.shape))

    @property
    def strides(self):
        return [step // self.data.itemsize for step in self.data.strides]

    def data_ptr(self):
        return self.data.ctypes.data

    def numpy(self):
        return self.data


class _Capsule:
    """NumPy reads capsules from objects only."""

    def __init__(self, capsule):
        self.capsule = capsule

    def __dlpack__(self, **_):
        return self.capsule

    def __dlpack_device__(self):
        return 1, 0


def stand_in():
    module, utils, dlpack = (types.ModuleType(n) for n in ("paddle", "utils", "dlpack"))
    for name in ("bool", "int8", "int16", "int32", "int64", "uint8", "float16", "float32"):
        setattr(module, name, name)
    module.float64, module.complex64 = "float64", "complex64"
    module.is_grad_enabled = lambda: True
    module.to_tensor = lambda data: Tensor(np.array(data))
    module.zeros_like = lambda t: Tensor(np.zeros_like(t.data))
    dlpack.from_dlpack = lambda capsule: Tensor(np.from_dlpack(_Capsule(capsule)))
    module.utils, utils.dlpack = utils, dlpack
    return {"paddle": module, "paddle.utils": utils, "paddle.utils.dlpack": dlpack}


@pytest.fixture(params=["stand-in", "installed"])
def paddle(request, monkeypatch):
    from warp._src.interop import paddle as ours

    if request.param == "installed":
        if installed is None:
            pytest.skip("Paddle is not installed")
        made = installed
    else:
        for name, module in stand_in().items():
            monkeypatch.setitem(sys.modules, name, module)
        made = sys.modules["paddle"]
    ours._dtypes.cache_clear()
    yield made
    ours._dtypes.cache_clear()


def test_types_and_devices(paddle):
    for scalar in (wp.bool, wp.int8, wp.int64, wp.uint8, wp.float16, wp.float32, wp.float64):
        dtype = wp.dtype_to_paddle(scalar)
        assert dtype == getattr(paddle, scalar.__name__)
        assert wp.dtype_from_paddle(dtype) is scalar
    assert wp.dtype_to_paddle(wp.uint32) == paddle.int32
    assert wp.dtype_to_paddle(int) == paddle.int32
    with pytest.raises(TypeError, match="no scalar type"):
        wp.dtype_from_paddle(paddle.complex64)
    assert wp.device_to_paddle("cpu") == "cpu"
    for place in ("cpu", "Place(cpu)", "gpu_pinned"):
        assert wp.device_from_paddle(place) is wp.get_device("cpu")
    with pytest.raises(RuntimeError, match="xpu:0"):
        wp.device_from_paddle("Place(xpu:0)")
    with pytest.raises(ValueError, match="cuda:77"):
        wp.device_from_paddle("gpu:77")


def test_memory_is_shared(paddle):
    t = paddle.to_tensor(np.arange(12, dtype=np.float32).reshape(4, 3))
    a = wp.from_paddle(t, dtype=wp.vec3)
    assert (a.ptr, a.shape, a.dtype) == (t.data_ptr(), (4,), wp.vec3f)
    a.fill_(wp.vec3(1.0, 2.0, 3.0))
    assert np.array_equal(t.numpy(), [[1.0, 2.0, 3.0]] * 4)
    assert wp.from_paddle(t).shape == (4, 3) and not a.requires_grad
    back = wp.to_paddle(a)
    assert back.data_ptr() == a.ptr and list(back.shape) == [4, 3] and back.stop_gradient
    numbers = wp.array([1, 2, 3], dtype=wp.uint32, device="cpu")
    signed = wp.to_paddle(numbers)
    assert signed.data_ptr() == numbers.ptr and signed.dtype == paddle.int32
    assert np.array_equal(wp.from_paddle(signed, dtype=wp.uint32).numpy(), [1, 2, 3])


def test_gradients_are_shared(paddle):
    t = paddle.to_tensor(np.ones(5, dtype=np.float32))
    t.stop_gradient = False
    a = wp.from_paddle(t, retain_grad=True)
    assert a.requires_grad and a.retain_grad and a.grad.ptr == t.grad.data_ptr()
    assert wp.from_paddle(t, requires_grad=False).grad is None
    given = wp.zeros(5, dtype=float, device="cpu")
    assert wp.from_paddle(t, grad=given).grad is given
    half = paddle.to_tensor(np.ones(5, dtype=np.float16))
    narrow = paddle.to_tensor(np.ones(5, dtype=np.float16))
    assert wp.from_paddle(half, grad=narrow).grad.ptr == narrow.data_ptr()
    with pytest.raises(ValueError, match="gradient of 'float16' or 'float32' for an array"):
        wp.from_paddle(half, grad=paddle.to_tensor(np.ones(5)))
    made = wp.zeros(3, dtype=float, device="cpu", requires_grad=True)
    shown = wp.to_paddle(made)
    assert not shown.stop_gradient and shown.grad.data_ptr() == made.grad.ptr
    assert wp.to_paddle(made, requires_grad=False).stop_gradient


def test_what_cannot_be_exchanged(paddle):
    t = paddle.to_tensor(np.ones((2, 3), dtype=np.float32))
    with pytest.raises(TypeError, match="expects a dense tensor"):
        wp.from_paddle([1.0])
    with pytest.raises(TypeError, match="int32"):
        wp.from_paddle(t, dtype=int)
    with pytest.raises(ValueError, match=r"inner dimensions \(2,\)"):
        wp.from_paddle(t, dtype=wp.vec2)
    with pytest.raises(TypeError, match="expects an array"):
        wp.to_paddle(t)

    @wp.struct
    class Pair:
        a: float

    with pytest.raises(TypeError, match="no type for elements of struct 'Pair'"):
        wp.to_paddle(wp.zeros(2, dtype=Pair, device="cpu"))


def test_import_leaves_paddle_alone():
    import subprocess

    code = "import sys, warp; warp.zeros(3); sys.exit('paddle' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
