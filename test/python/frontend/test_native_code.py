"""`wp.func_native`: C++ that Clang compiles and kernels on CPUs call."""

import numpy as np
import pytest

import warp as wp
from warp._src.kernels import native_code

needs_clang = pytest.mark.skipif(native_code.compiler() is None, reason="no Clang")


@wp.func_native("return 1.0f / sqrtf(value);")
def inverse_root(value: float) -> float: ...


@wp.func_native("uint32_t i; memcpy(&i, &f, 4); return (wp::uint64(i) << shift) | low;")
def pack(f: float, shift: int, low: wp.uint8) -> wp.uint64: ...


@wp.func_native("WP_TILE_SYNC();")
def barrier(): ...


@wp.kernel
def call(x: wp.array(dtype=float), y: wp.array(dtype=float), bits: wp.array(dtype=wp.uint64)):
    i = wp.tid()
    barrier()
    y[i] = inverse_root(x[i])
    bits[i] = pack(x[i], 8, wp.uint8(i))


@needs_clang
@pytest.mark.parametrize("count", [1, 37])
def test_every_lane_gets_its_own_result(count):
    x = np.linspace(1.0, 9.0, count).astype(np.float32)
    y = wp.zeros(count, dtype=float, device="cpu")
    bits = wp.zeros(count, dtype=wp.uint64, device="cpu")
    wp.launch(call, count, [wp.array(x, device="cpu"), y, bits], device="cpu")
    np.testing.assert_array_equal(y.numpy(), np.float32(1) / np.sqrt(x))
    expected = (x.view(np.uint32).astype(np.uint64) << np.uint64(8)) | np.arange(count).astype("u8")
    np.testing.assert_array_equal(bits.numpy(), expected)


def refused(kernel, *arguments):
    with pytest.raises(wp.WarpCodegenError) as problem:
        wp.launch(kernel, 1, arguments, device="cpu")
    return str(problem.value)


@needs_clang
def test_words_of_clang_and_the_place_of_the_call():
    @wp.func_native("return not_there;")
    def broken(x: float) -> float: ...

    @wp.kernel
    def uses(y: wp.array(dtype=float)):
        y[0] = broken(1.0)

    message = refused(uses, wp.zeros(1, device="cpu"))
    assert "not_there" in message and "y[0] = broken(1.0)" in message and "test_native" in message


def test_without_clang(monkeypatch):
    @wp.func_native("return 2.0f * x;")
    def twice(x: float) -> float: ...

    @wp.kernel
    def uses(y: wp.array(dtype=float)):
        y[0] = twice(1.0)

    monkeypatch.setattr(native_code, "compiler", lambda: None)
    message = refused(uses, wp.zeros(1, device="cpu"))
    assert "needs Clang" in message and "WARP_CLANG" in message and "twice(1.0)" in message


def test_what_cannot_be_passed():
    @wp.func_native("x[0] = 1.0f;")
    def store(x: wp.vec3) -> int: ...

    @wp.func_native("return;")
    def nothing(x: float): ...

    @wp.kernel
    def stores(y: wp.array(dtype=float)):
        store(wp.vec3(y[0]))

    @wp.kernel
    def returns_nothing(y: wp.array(dtype=float)):
        nothing(y[0])

    y = wp.zeros(1, device="cpu")
    assert "parameter 'x' is no number" in refused(stores, y)
    assert "returns no number" in refused(returns_nothing, y)


@needs_clang
def test_gradient_is_an_error_and_no_zero():
    @wp.kernel
    def root(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        y[0] = inverse_root(x[0])

    x = wp.ones(1, requires_grad=True, device="cpu")
    y = wp.zeros(1, requires_grad=True, device="cpu")
    with wp.Tape() as tape:
        wp.launch(root, 1, [x, y], device="cpu")
    with pytest.raises(RuntimeError):
        tape.backward(y)


@needs_clang
def test_code_for_gpus_is_refused():
    @wp.kernel
    def root(x: wp.array(dtype=float)):
        x[wp.tid()] = inverse_root(x[wp.tid()])

    with pytest.raises(RuntimeError, match="native function, which is compiled for CPUs only"):
        root.ir("ptx", arch=90)
