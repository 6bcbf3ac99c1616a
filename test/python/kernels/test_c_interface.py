"""The C interface: a C program loads what Python saved, and gets a message for each mistake."""

import shutil
import subprocess
from pathlib import Path

import pytest

import warp as wp

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "c"
PACKAGE = Path(wp.__file__).parent


def compile_program(source, program, standard):
    compiler = shutil.which("cc")
    if not compiler:
        pytest.skip("needs a C compiler")
    flags = [f"-std={standard}", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1"]
    links = [PACKAGE / "libwarp.so", f"-Wl,-rpath,{PACKAGE}"]
    command = [compiler, *flags, "-I", wp.get_include(), source, "-o", program, *links]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return program


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return compile_program(EXAMPLE / "saxpy.c", tmp_path_factory.mktemp("c") / "saxpy", "c99")


def test_c_program(program, tmp_path, device, monkeypatch):
    """y = 2 x + 1 and x doubled twice, checked by the program; messages of two wrong launches."""
    monkeypatch.syspath_prepend(EXAMPLE)
    import saxpy_kernels

    module, graph = saxpy_kernels.save(tmp_path, device)
    number = "-1" if device == "cpu" else device.split(":")[1]
    done = subprocess.run([program, module, graph, number], capture_output=True, text=True)
    assert done.stderr == "" and done.returncode == 0, done.stdout
    lines = done.stdout.splitlines()
    assert lines[0] == "launch('saxpy'): expects 3 arguments, but got 2"
    assert lines[1] == "launch('saxpy'): argument 'a' expects f32, but got si32"
    assert lines[2].startswith(f"1000 elements, release {wp.__version__}")


def test_files_that_are_not_there_are_named(program):
    done = subprocess.run([program, "no.warp", "no.wrp"], capture_output=True, text=True)
    assert done.returncode == 1
    expected = "load: saved module 'no.warp' cannot be read: No such file or directory\n"
    assert done.stderr == expected


WRONG = """
#include "warp/warp.h"
#include <stdio.h>
int main(int count, char **words) {
  warp_module *module;
  warp_kernel *kernel;
  float x[8] = {0}, a = 1;
  int64_t extent = 4;
  (void)count;
  if (warp_module_load(words[1], &module)) return 1;
  if (warp_module_kernel(module, "axpy", &kernel)) puts(warp_last_error());
  if (warp_module_kernel(module, "saxpy", &kernel)) return 1;
  warp_argument good[] = {warp_vector(x, 4, 4), warp_vector(x + 4, 4, 4), warp_value(&a, 4)};
  warp_argument bad[3];
#define TRY(change) \\
  for (int i = 0; i < 3; ++i) bad[i] = good[i]; \\
  change; \\
  if (warp_kernel_launch(kernel, WARP_CPU, 1, &extent, 3, bad)) puts(warp_last_error()); \\
  else puts("launched");
  TRY(bad[0].bytes = 8)
  TRY(bad[0].rank = 0)
  TRY(bad[2].rank = 1)
  TRY(bad[0].rank = 2)
  TRY(bad[0].shape[0] = -1)
  TRY(bad[0].shape[0] = (int64_t)1 << 40)
  TRY(bad[0].type = "f64")
  TRY(bad[0].strides[0] = 4)
  warp_kernel_free(kernel);
  warp_module_free(module);
  warp_module_free(NULL);
  return 0;
}
"""


def test_wrong_arguments_are_named(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLE)
    import saxpy_kernels

    module, _ = saxpy_kernels.save(tmp_path)
    source = tmp_path / "wrong.c"
    source.write_text(WRONG)
    program = compile_program(source, tmp_path / "wrong", "c11")
    done = subprocess.run([program, module], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "'axpy'" in lines[0]
    expects = "launch('saxpy'): argument '{}' expects {}, but got {}"
    array = "!warp.array<1 x f32>"
    assert lines[1:] == [
        expects.format("x", array, "an array with elements of 8 bytes instead of 4"),
        expects.format("x", array, "a value"),
        expects.format("a", "f32", "an array"),
        expects.format("x", array, "an array of 2 dimensions"),
        "extents and strides of an array are below 2^31",
        "extents and strides of an array are below 2^31",
        expects.format("x", array, "an array with elements of f64"),
        "launched",
    ]
