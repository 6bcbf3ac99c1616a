"""The library without a compiler, libwarp_runtime.so, and its wheel."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warp as wp

ROOT = Path(__file__).resolve().parents[3]
LIBRARY = Path(wp.__file__).parents[2] / "lib" / "libwarp_runtime.so"
NM = Path("/usr/lib/llvm-22/bin/llvm-nm")

pytestmark = pytest.mark.skipif(not LIBRARY.is_file(), reason="needs a build tree")


@wp.kernel(module="runtime_library")
def functions(
    x: wp.array(dtype=float),
    h: wp.array(dtype=wp.float16),
    y: wp.array(dtype=float),
    n: wp.array(dtype=int),
):
    i = wp.tid()
    h[i] = wp.float16(x[i] * 3.7)
    y[i] = wp.sin(x[i]) + wp.pow(wp.abs(x[i]), 1.3) + float(h[i])
    wp.atomic_add(n, 0, 1)
    if i == 3:
        wp.printf("thread %d\n", i)


@wp.kernel(module="runtime_library")
def factor(a: wp.array2d(dtype=float), lower: wp.array2d(dtype=float)):
    wp.tile_store(lower, wp.tile_cholesky(wp.tile_load(a, shape=(8, 8))))


# A process of its own, which never loads the library with the compiler.
PROGRAM = """
import ctypes, sys
import numpy as np

library = ctypes.CDLL(sys.argv[1])
library.warp_last_error.restype = ctypes.c_char_p


class Argument(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("bytes", ctypes.c_size_t), ("type", ctypes.c_char_p),
                ("rank", ctypes.c_int), ("shape", ctypes.c_int64 * 4),
                ("strides", ctypes.c_int64 * 4)]


def call(name, *arguments):
    if getattr(library, name)(*arguments):
        raise SystemExit(library.warp_last_error().decode())


def launch(name, extent, *arrays):
    kernel = ctypes.c_void_p()
    call("warp_module_kernel", module, name.encode(), ctypes.byref(kernel))
    described = [Argument(a.ctypes.data, a.itemsize, None, a.ndim,
                          (ctypes.c_int64 * 4)(*a.shape), (ctypes.c_int64 * 4)()) for a in arrays]
    call("warp_kernel_launch", kernel, -1, 1, (ctypes.c_int64 * 1)(extent), len(arrays),
         (Argument * len(arrays))(*described))


module = ctypes.c_void_p()
call("warp_module_load", sys.argv[2].encode(), ctypes.byref(module))
given = np.load(sys.argv[3])
x, a = given["x"], given["a"]
y, h, n = np.zeros_like(x), np.zeros(len(x), np.float16), np.zeros(1, np.int32)
launch("functions", len(x), x, h, y, n)
lower = np.zeros_like(a)
launch("factor", 1, a, lower)
np.savez(sys.argv[4], y=y, h=h, n=n, lower=lower)
print(any("libwarp.so" in line for line in open("/proc/self/maps")))
"""


def test_saved_kernels_have_the_same_bits(tmp_path):
    """Math, halves, atomics, printf, and a factor of the device library's machine code."""
    x = np.linspace(-3.0, 3.0, 1000, dtype=np.float32)
    matrix = np.random.default_rng(0).normal(size=(8, 8))
    matrix = (matrix @ matrix.T + 8.0 * np.eye(8)).astype(np.float32)
    outputs = [wp.zeros(1000, dtype=kind, device="cpu") for kind in (wp.float16, float)]
    count = wp.zeros(1, dtype=int, device="cpu")
    arguments = [wp.array(x, device="cpu"), *outputs, count]
    wp.launch(functions, 1000, arguments, device="cpu")
    lower = wp.zeros((8, 8), dtype=float, device="cpu")
    tile = wp.array(matrix, device="cpu")
    wp.launch_tiled(factor, [1], [tile, lower], block_dim=32, device="cpu")
    options = {"device": "cpu", "module_dir": tmp_path, "strip_hash": True}
    (saved,) = wp.compile_aot_module("runtime_library", **options)
    np.savez(tmp_path / "given.npz", x=x, a=matrix)
    files = [saved, tmp_path / "given.npz", tmp_path / "found.npz"]
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, LIBRARY, *files], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert sorted(done.stdout.split("\n")) == ["", "False", "thread 3"]
    found = np.load(tmp_path / "found.npz")
    assert np.array_equal(found["h"], outputs[0].numpy())
    assert np.array_equal(found["y"], outputs[1].numpy())
    assert found["n"][0] == count.numpy()[0] == 1000
    assert np.array_equal(found["lower"], lower.numpy())
    assert np.abs(found["lower"] - np.linalg.cholesky(matrix.astype(np.float64))).max() < 1e-5


def test_it_is_small_and_has_no_llvm(tmp_path):
    if not NM.is_file():
        pytest.skip("needs LLVM's tools")
    names = subprocess.run([NM, "-C", LIBRARY], check=True, capture_output=True, text=True).stdout
    assert "warp::SavedModule::load" in names
    assert "llvm::" not in names and "mlir::" not in names
    subprocess.run(["strip", "-o", tmp_path / "stripped.so", LIBRARY], check=True)
    assert (tmp_path / "stripped.so").stat().st_size <= 8_000_000


def test_c_program_runs_a_saved_graph(tmp_path, monkeypatch):
    """The example of the C interface, linked against this library."""
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("needs a C compiler")
    example = ROOT / "examples" / "c"
    monkeypatch.syspath_prepend(example)
    import saxpy_kernels

    module, graph = saxpy_kernels.save(tmp_path, "cpu")
    program = tmp_path / "saxpy"
    links = [LIBRARY, f"-Wl,-rpath,{LIBRARY.parent}"]
    command = [compiler, "-std=c99", "-I", wp.get_include(), example / "saxpy.c", "-o", program]
    subprocess.run([*command, *links], check=True, capture_output=True)
    done = subprocess.run([program, module, graph, "-1"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1000 elements" in done.stdout


def test_wheel_has_a_cmake_target(tmp_path):
    if not (shutil.which("cmake") and shutil.which("c++")):
        pytest.skip("needs CMake and a C++ compiler")
    script = ROOT / "scripts" / "make_runtime.py"
    made = [sys.executable, script, tmp_path / "dist", "--library", LIBRARY, "--level", "0"]
    subprocess.run(made, check=True, capture_output=True)
    (wheel,) = (tmp_path / "dist").iterdir()
    place = tmp_path / "packages"
    install = [sys.executable, "-m", "pip", "install", "-q", "--no-index", "--target", place, wheel]
    subprocess.run(install, check=True, capture_output=True)
    project = tmp_path / "project"
    project.mkdir()
    shutil.copy(ROOT / "examples" / "cpp" / "integrate.cpp", project)
    (project / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.20)\nproject(own LANGUAGES CXX)\n"
        f"find_package(warp_runtime {wp.__version__} EXACT REQUIRED)\n"
        "add_executable(integrate integrate.cpp)\n"
        "target_link_libraries(integrate PRIVATE warp::runtime)\n"
        "find_package(warp_runtime 99 QUIET)\n"
        'if(warp_runtime_FOUND)\n  message(FATAL_ERROR "accepts version 99")\nendif()\n'
    )
    environ = {**os.environ, "PYTHONPATH": str(place)}
    folder = subprocess.run(
        [sys.executable, "-m", "warp_runtime"], check=True, capture_output=True, text=True,
        env=environ,
    ).stdout.strip()  # fmt: skip
    build = project / "build"
    subprocess.run(
        ["cmake", "-S", project, "-B", build, f"-Dwarp_runtime_DIR={folder}"],
        check=True, capture_output=True,
    )  # fmt: skip
    done = subprocess.run(["cmake", "--build", build], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    kernels = [sys.executable, ROOT / "examples" / "cpp" / "integrate_kernels.py", tmp_path]
    subprocess.run(kernels, check=True, capture_output=True)
    (module,) = tmp_path.glob("*.warp")
    done = subprocess.run([build / "integrate", module, "-1"], capture_output=True, text=True)
    assert done.stdout == "1000 particles at height 0.0460 on cpu\n", done.stderr
