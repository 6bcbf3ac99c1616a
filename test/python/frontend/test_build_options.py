"""`wp.ModuleBuildOptions`: headers and texts that native functions of a module need."""

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.usefixtures("native_device")
BOTH = ("cpu", "cuda")


def options(folder=None, preamble="", files=None):
    """The same for CPUs and GPUs."""
    folders = [folder] if folder else None
    return wp.ModuleBuildOptions(
        **{f"extra_{kind}_include_dirs": folders for kind in BOTH},
        **{f"extra_{kind}_preamble": preamble for kind in BOTH},
        extra_build_dependencies=files,
    )


def make_kernel(snippet):
    @wp.func_native(snippet)
    def change(x: float) -> float: ...

    @wp.kernel(module="unique")
    def apply(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = change(x[i])

    return apply


def run(kernel):
    x, y = wp.array(np.arange(5.0), dtype=float), wp.zeros(5, dtype=float)
    wp.launch(kernel, 5, [x], [y])
    return y.numpy()


def test_text_before_functions():
    kernel = make_kernel("return offset(x) * FACTOR;")
    text = "#define FACTOR 3.0f\nstatic inline float offset(float x) { return x + 1.0f; }"
    wp.set_module_options({"extra_build_options": options(preamble=text)}, kernel.module)
    np.testing.assert_array_equal(run(kernel), 3.0 * (np.arange(5) + 1))


def test_functions_with_arrays():
    @wp.func_native("y[i] = LIMIT * x[i];")
    def scale(x: wp.array(dtype=float), y: wp.array(dtype=float), i: int): ...

    @wp.kernel(module="unique")
    def apply(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        scale(x, y, wp.tid())

    wp.set_module_options(
        {"extra_build_options": options(preamble="constexpr float LIMIT = 4.0f;")}, apply.module
    )
    np.testing.assert_array_equal(run(apply), 4.0 * np.arange(5))


def test_headers_and_files_that_change(tmp_path):
    header = tmp_path / "factor.h"
    kernel = make_kernel("return FACTOR * x;")
    for factor in (2.0, 5.0):
        header.write_text(f"#define FACTOR {factor}f\n")
        made = options(tmp_path, '#include "factor.h"', [header])
        wp.set_module_options({"extra_build_options": made}, kernel.module)
        np.testing.assert_array_equal(run(kernel), factor * np.arange(5))


def test_joined_options():
    first, second = options("/usr", "#define A"), options("/usr", "#define B\n", ["/etc/hosts"])
    joined = first.merged(second, options("/etc"))
    assert joined.extra_cpu_include_dirs == joined.extra_cuda_include_dirs == ["/usr", "/etc"]
    assert joined.extra_cpu_preamble == "#define A\n#define B\n"
    assert joined.extra_build_dependencies == ["/etc/hosts"]
    assert first.extra_cpu_preamble == "#define A" and second.extra_cpu_include_dirs == ["/usr"]


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: options(preamble=3), "extra_cuda_preamble must be a str, but got 'int'"),
        (lambda: options("include"), "expects absolute paths of folders, but got 'include'"),
        (lambda: options("/no/where"), "expects absolute paths of folders, but got '/no/where'"),
        (lambda: options(files=["/usr"]), "expects absolute paths of files, but got '/usr'"),
        (lambda: {}, "must be a ModuleBuildOptions instance, but got 'dict'"),
        (lambda: options().merged(3), "expects ModuleBuildOptions, but got 'int'"),
    ],
)
def test_what_is_refused(made, message):
    kernel = make_kernel("return x;")
    with pytest.raises((TypeError, ValueError), match=message):
        wp.set_module_options({"extra_build_options": made()}, kernel.module)
