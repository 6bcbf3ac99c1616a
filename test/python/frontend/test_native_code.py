"""`wp.func_native`: C++ that Clang compiles for kernels on CPUs, and NVRTC on GPUs."""

import os
import subprocess
import sys

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.usefixtures("native_device")


@wp.func_native("return 1.0f / sqrtf(value);")
def inverse_root(value: float) -> float: ...


@wp.func_native("uint32_t i; memcpy(&i, &f, 4); return (wp::uint64(i) << shift) | low;")
def pack(f: float, shift: int, low: wp.uint8) -> wp.uint64: ...


@wp.kernel
def call(x: wp.array(dtype=float), y: wp.array(dtype=float), bits: wp.array(dtype=wp.uint64)):
    i = wp.tid()
    y[i] = inverse_root(x[i])
    bits[i] = pack(x[i], 8, wp.uint8(i))


@pytest.mark.parametrize("count", [1, 37])
def test_every_lane_gets_its_own_result(count):
    x = np.linspace(1.0, 9.0, count).astype(np.float32)
    y = wp.zeros(count, dtype=float)
    bits = wp.zeros(count, dtype=wp.uint64)
    wp.launch(call, count, [wp.array(x), y, bits])
    np.testing.assert_array_equal(y.numpy(), np.float32(1) / np.sqrt(x))
    expected = (x.view(np.uint32).astype(np.uint64) << np.uint64(8)) | np.arange(count).astype("u8")
    np.testing.assert_array_equal(bits.numpy(), expected)


def refused(kernel, *arguments):
    with pytest.raises(wp.WarpError) as problem:
        wp.launch(kernel, 1, arguments)
        wp.synchronize()
    return str(problem.value)


def test_words_of_clang_and_the_place_of_the_call():
    @wp.func_native("return not_there;")
    def broken(x: float) -> float: ...

    @wp.kernel
    def uses(y: wp.array(dtype=float)):
        y[0] = broken(1.0)

    message = refused(uses, wp.zeros(1))
    assert "not_there" in message and "y[0] = broken(1.0)" in message and "test_native" in message


WITHOUT_COMPILERS = """
import sys
import warp as wp

@wp.func_native("return 3.0f * x;")
def thrice(x: float) -> float: ...

@wp.kernel
def uses(y: wp.array(dtype=float)):
    y[0] = thrice(1.0)

uses.ir(sys.argv[1], **eval(sys.argv[2]))
"""


# A compiler that was found stays, so in a process of its own.
@pytest.mark.parametrize(
    ("compiler", "stage", "options"),
    [("Clang", "asm", "dict()"), ("NVRTC", "ptx", "dict(arch=90)")],
)
def test_without_compilers(compiler, stage, options, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(WITHOUT_COMPILERS)
    variable = f"WARP_{compiler.upper()}"
    done = subprocess.run(
        [sys.executable, program, stage, options],
        env={**os.environ, variable: "/nowhere/compiler"},
        capture_output=True,
        text=True,
        check=False,
    )
    words = done.stderr
    assert done.returncode == 1 and "WarpCompileError" in words
    assert f"needs {compiler}" in words and variable in words and "thrice(1.0)" in words


@wp.struct
class Pair:
    x: float
    y: float


def test_what_cannot_be_passed():
    @wp.func_native("x[0] = 1.0f;")
    def store(x: wp.vec3h) -> int: ...

    @wp.func_native("return;")
    def nothing(x: float): ...

    @wp.func_native("return {};")
    def pair(x: float) -> Pair: ...

    @wp.func_native("return x;")
    def same(x: wp.array(dtype=float)) -> wp.array(dtype=float): ...

    @wp.kernel
    def stores(y: wp.array(dtype=float)):
        store(wp.vec3h(wp.float16(y[0])))

    @wp.kernel
    def returns_struct(y: wp.array(dtype=float)):
        y[0] = pair(y[0]).x

    @wp.kernel
    def returns_array(y: wp.array(dtype=float)):
        y[0] = same(y)[0]

    @wp.kernel
    def returns_nothing(y: wp.array(dtype=float)):
        nothing(y[0])

    y = wp.zeros(1)
    assert "whose 'x' C++ has no type for" in refused(stores, y)
    for kernel in (returns_struct, returns_array):
        with pytest.raises(wp.WarpCodegenError) as caught:
            wp.launch(kernel, 1, [y])
            wp.synchronize()
        assert caught.value.code == "native-return"
    assert "returns no number" in refused(returns_nothing, y)


def test_gradient_is_an_error_and_no_zero():
    @wp.kernel
    def root(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        y[0] = inverse_root(x[0])

    x = wp.ones(1, requires_grad=True)
    y = wp.zeros(1, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(root, 1, [x, y])
    with pytest.raises(RuntimeError):
        tape.backward(y)
        wp.synchronize()


@wp.func_native("""
#if defined(__CUDA_ARCH__)
  for (int offset = 16; offset > 0; offset /= 2)
    value = fmaxf(value, __shfl_xor_sync(0xffffffffu, value, offset));
#endif
  return value;
""")
def most_of_warp(value: float) -> float: ...


@wp.func_native("""
#if defined(__CUDA_ARCH__)
  __syncwarp(0xffffffffu);
#endif
""")
def wait_for_warp(): ...


@wp.kernel
def maxima(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    most = most_of_warp(x[i, j])
    if i % 2 == 0:
        wait_for_warp()
        y[i, j] = most


def test_threads_meet_in_native_code(device):
    threads = 1 if device == "cpu" else 64
    x = np.random.default_rng(1).random((20, threads), np.float32)
    y = wp.zeros_like(wp.array(x))
    wp.launch_tiled(maxima, 20, [wp.array(x), y], block_dim=threads)
    warps = x.reshape(20, -1, min(threads, 32))
    expected = np.broadcast_to(warps.max(axis=2, keepdims=True), warps.shape).reshape(x.shape)
    np.testing.assert_array_equal(y.numpy()[::2], expected[::2])
    assert not y.numpy()[1::2].any()


@wp.func_native("return nextafterf(x, INFINITY) + remainderf(x, 2.0f) + fdimf(x, 1.0f) + logbf(x);")
def next_float(x: float) -> float: ...


@wp.kernel
def call_library(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    y[wp.tid()] = next_float(x[wp.tid()])


def test_functions_of_the_c_library():
    x = np.linspace(0.1, 9.0, 37).astype(np.float32)
    y = wp.zeros(37, dtype=float)
    wp.launch(call_library, 37, [wp.array(x), y])
    after = np.nextafter(x, np.float32(np.inf))
    rest = x - 2 * np.rint(x / 2)
    expected = after + rest + np.maximum(x - 1, 0) + np.floor(np.log2(x))
    np.testing.assert_allclose(y.numpy(), expected, rtol=1e-6, atol=1e-6)
