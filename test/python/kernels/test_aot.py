"""Modules compiled ahead of time, in this process, in another, and in a C++ program."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warp as wp

ENVIRON = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "cpp"

SOURCE = """
import warp as wp

@wp.func
def twice(x: float):
    return {factor} * x

@wp.kernel
def scale(x: wp.array(dtype=float), offset: int, s: float):
    i = wp.tid()
    x[i + offset] = twice(x[i + offset]) * s

@wp.kernel
def outer(a: wp.array(dtype=wp.vec3), b: wp.array2d(dtype=float)):
    i, j = wp.tid()
    b[i, j] = a[i][0] + a[j][1]

@wp.kernel
def count(n: wp.array(dtype=int)):
    wp.atomic_add(n, 0, 1)
"""

RUN = """
import sys, numpy as np
sys.path.insert(0, sys.argv[1])
import saved_example as m
import warp as wp
wp.config.quiet = True
wp.config.cache_kernels = False
wp.load_aot_module(m, device="cpu", module_dir=sys.argv[1], strip_hash=True)
x = wp.array(np.arange(8.0), dtype=float, device="cpu")
wp.launch(m.scale, 8, [x, 0, 3.0], device="cpu")
wp.launch(m.scale, 4, [x[::2], 0, 0.5], device="cpu")
print(x.numpy().tolist())
a = wp.array([[1, 2, 3], [4, 5, 6]], dtype=wp.vec3, device="cpu")
b = wp.zeros((2, 2), dtype=float, device="cpu")
wp.launch(m.outer, (2, 2), [a, b], device="cpu")
print(b.numpy().tolist())
n = wp.zeros(1, dtype=int, device="cpu")
wp.launch(m.count, 100000, [n], device="cpu")
print(n.numpy().tolist())
compiled = [k.native.compile_times() for k in (m.scale, m.outer, m.count)]
print([bool(times.get("compile")) for times in compiled])
"""


@pytest.fixture
def example(tmp_path, monkeypatch):
    """A Python module with kernels, imported from a folder of its own."""
    (tmp_path / "saved_example.py").write_text(SOURCE.format(factor="2.0"))
    monkeypatch.syspath_prepend(tmp_path)
    sys.modules.pop("saved_example", None)
    import saved_example

    yield saved_example
    sys.modules.pop("saved_example", None)


def python(code, *args):
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, args)], capture_output=True, text=True, env=ENVIRON
    )


def test_another_process_launches_without_compiling(example, tmp_path):
    paths = wp.compile_aot_module(example, device="cpu", module_dir=tmp_path, strip_hash=True)
    assert [path.name for path in paths] == ["wp_saved_example.cpu.warp"]
    result = python(RUN, tmp_path)
    assert result.stderr == ""
    assert result.stdout.splitlines() == [
        "[0.0, 6.0, 12.0, 18.0, 24.0, 30.0, 36.0, 42.0]",
        "[[3.0, 6.0], [6.0, 9.0]]",
        "[100000]",
        "[False, False, False]",
    ]


def test_changed_kernels_do_not_fit(example, tmp_path):
    wp.compile_aot_module(example, device="cpu", module_dir=tmp_path, strip_hash=True)
    (tmp_path / "saved_example.py").write_text(SOURCE.format(factor="2.5"))
    result = python(RUN, tmp_path)
    assert result.returncode != 0
    assert "kernel 'scale' does not fit its saved code: its source has changed" in result.stderr


def test_damaged_and_missing_files(example, tmp_path):
    (path,) = wp.compile_aot_module(example, device="cpu", module_dir=tmp_path, strip_hash=False)
    assert path.name.startswith("wp_saved_example_") and path.name.endswith(".cpu.warp")
    wp.load_aot_module("saved_example", device="cpu", module_dir=tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[:-3])
    with pytest.raises(RuntimeError, match="is damaged"):
        wp.load_aot_module(example, device="cpu", module_dir=tmp_path)
    with pytest.raises(FileNotFoundError, match="no saved module, tried"):
        wp.load_aot_module(example, device="cpu", module_dir=tmp_path / "nowhere")
    with pytest.raises(TypeError, match="expects a module"):
        wp.compile_aot_module(3)
    with pytest.raises(RuntimeError, match="no kernels, or was not imported"):
        wp.compile_aot_module("no.such.module")
    with pytest.raises(ValueError, match="no GPU architecture '12'"):
        wp.compile_aot_module(example, arch=12, module_dir=tmp_path)


def test_architectures_without_their_gpus(example, tmp_path):
    paths = wp.compile_aot_module(
        example, device="cpu", arch=[80, 90], module_dir=tmp_path, strip_hash=True
    )
    assert [path.name.split(".")[1] for path in paths] == ["sm_80", "sm_90", "cpu"]
    assert b".target sm_80" in paths[0].read_bytes()
    assert b".entry outer" in paths[1].read_bytes()
    devices = {device.arch for device in wp.get_cuda_devices()}
    if 75 not in devices:
        with pytest.raises(RuntimeError, match="machine code for 'sm_75' needs such a device"):
            wp.compile_aot_module(example, arch=75, module_dir=tmp_path, use_ptx=False)


def test_saved_code_and_launches_beyond_it(example, tmp_path, device):
    wp.compile_aot_module(example, device=device, module_dir=tmp_path)
    wp.load_aot_module(example, device=device, module_dir=tmp_path)
    n = wp.zeros(1, dtype=int, device=device)
    wp.launch(example.count, 1000, [n], device=device)
    wp.launch(example.count, (10, 20, 30), [n], device=device)
    assert n.numpy()[0] == 7000
    x = wp.array(np.arange(8.0), dtype=float, device=device)
    wp.launch(example.scale, 4, [x[::2], 0, 1.0], device=device)
    wp.launch(example.scale, 1, [x, -1, 1.0], device=device)
    assert x.numpy().tolist() == [0, 1, 4, 3, 8, 5, 12, 14]


@wp.kernel(module="aot_generic")
def fill(x: wp.array(dtype=wp.Float), value: wp.Float):
    i = wp.tid()
    x[i] = value


def test_generic_kernels_save_what_was_launched(tmp_path, device):
    x = wp.zeros(3, dtype=wp.float64, device=device)
    wp.launch(fill, 3, [x, wp.float64(2.0)], device=device)
    wp.compile_aot_module("aot_generic", device=device, module_dir=tmp_path, strip_hash=True)
    wp.load_aot_module("aot_generic", device=device, module_dir=tmp_path, strip_hash=True)
    wp.launch(fill, 3, [x, wp.float64(3.0)], device=device)
    assert x.numpy().tolist() == [3, 3, 3]


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The example of the guide: configured and built as a user would."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if not compiler:
        pytest.skip("needs a C++ compiler")
    folder = tmp_path_factory.mktemp("integrate")
    program = folder / "integrate"
    if shutil.which("cmake"):
        configure = ["cmake", "-S", EXAMPLE, "-B", folder, f"-DWARP_ROOT={wp.get_cmake_dir()}"]
        commands = [configure, ["cmake", "--build", folder]]
    else:
        package = Path(wp.__file__).parent
        source = [EXAMPLE / "integrate.cpp", "-I", wp.get_include(), package / "libwarp.so"]
        commands = [[compiler, "-std=c++17", *source, "-o", program, f"-Wl,-rpath,{package}"]]
    for command in commands:
        done = subprocess.run(command, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    return program


def run_program(program, module, device="cpu"):
    number = "-1" if device == "cpu" else device.split(":")[1]
    return subprocess.run([program, module, number], capture_output=True, text=True)


def test_cpp_program(program, tmp_path, device, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLE)
    import integrate_kernels

    (module,) = wp.compile_aot_module(
        integrate_kernels, device=device, module_dir=tmp_path / "code", strip_hash=True
    )
    modules = [module]
    if device != "cpu":
        modules += integrate_kernels.save(tmp_path, wp.get_device(device).arch)
    for module in modules:
        done = run_program(program, module, device)
        assert done.stderr == "" and done.returncode == 0, done.stdout
        assert done.stdout == f"1000 particles at height 0.0460 on {device}\n"


def test_cpp_program_says_what_is_wrong(program, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLE)
    import integrate_kernels

    done = run_program(program, "absent.warp")
    assert done.returncode == 1
    assert done.stderr == ("saved module 'absent.warp' cannot be read: No such file or directory\n")
    (module,) = integrate_kernels.save(tmp_path, 90)
    done = run_program(program, module)
    assert done.returncode == 1
    assert done.stderr == (
        "launch('integrate'): no code was saved for (cpu, 1 dimension), there is: "
        "(sm_90, 1 dimension, blocks of 256)\n"
    )


def test_headers_are_in_the_package():
    folder = Path(wp.get_include()) / "warp"
    assert (folder / "SavedModule.h").is_file() and (folder / "Array.h").is_file()
    assert (Path(wp.get_cmake_dir()) / "warpConfig.cmake").is_file()
