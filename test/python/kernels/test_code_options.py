"""Options of kernels and modules that reach the generated code."""

import re
import typing

import pytest

import warp as wp


def math(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = wp.exp(x[i]) + 1.0 / wp.sqrt(x[i]) + wp.sin(x[i]) / x[i]


@wp.kernel
def of_any_type(x: wp.array(dtype=typing.Any)):
    x[wp.tid()] += x[0]


def ptx(arch=90, **options):
    module_options = options.pop("module_options", {})
    kernel = wp.kernel(module="options_of_code", module_options=module_options, **options)(math)
    return kernel.ir("ptx", arch=arch)


def test_architectures_without_their_gpus():
    archs = wp.get_cuda_supported_archs()
    assert archs == sorted(archs) and {75, 80, 86, 89, 90, 100, 120} <= set(archs)
    for arch in (75, 80, 90, 120):
        assert f".target sm_{arch}" in ptx(arch)
    with pytest.raises(ValueError, match="architecture 33"):
        ptx(33)


def test_fast_math():
    text = ptx(module_options={"fast_math": True})
    for instruction in ("ex2.approx.ftz.f32", "rsqrt.approx.ftz.f32", "sin.approx.ftz.f32"):
        assert instruction in text
    assert "div.approx.ftz.f32" in text
    exact = ptx()
    assert "sin.approx" not in exact and "div.rn.f32" in exact
    # One over a root is approximated and corrected; subnormals stay numbers.
    assert "rsqrt.approx.ftz" not in exact and "fma.rn.f32" in exact


def test_lineinfo():
    text = ptx(module_options={"lineinfo": True})
    (file,) = re.findall(r'^\s*\.file\s+1 "(.*)"', text, re.M)
    assert file == __file__
    lines = {int(line) for line in re.findall(r"^\s*\.loc\s+1 (\d+)", text, re.M)}
    assert math.__code__.co_firstlineno + 2 in lines
    assert not re.search(r"^\s*\.(loc|file)\s", ptx(), re.M)
    kernel = wp.kernel(module="options_lines", module_options={"lineinfo": True})(math)
    assert re.search(rf"\.loc\s+1 {math.__code__.co_firstlineno + 2} ", kernel.ir("asm"))


def test_launch_bounds_and_registers():
    assert ".maxntid 256" in ptx() and ".minnctapersm" not in ptx()
    text = ptx(launch_bounds=128)
    assert ".maxntid 128" in text and ".minnctapersm" not in text
    text = ptx(launch_bounds=(128, 4))
    assert ".maxntid 128" in text and ".minnctapersm 4" in text
    assert ".maxnreg 32" in ptx(cuda_max_registers=32)
    for bounds in (0, (128, 0), 2048, (1, 2, 3)):
        with pytest.raises(ValueError, match="launch_bounds expects"):
            ptx(launch_bounds=bounds)
    with pytest.raises(TypeError, match="launch_bounds expects"):
        ptx(launch_bounds="many")
    for count in (0, 256):
        with pytest.raises(ValueError, match="cuda_max_registers expects"):
            ptx(cuda_max_registers=count)
    with pytest.raises(ValueError, match="cuda_max_registers and launch_bounds exclude"):
        ptx(cuda_max_registers=32, launch_bounds=128)


def test_module_options():
    name = "options_of_a_module"
    kernel = wp.kernel(module=name)(math)
    wp.set_module_options({"fast_math": True, "block_dim": 64}, wp.get_module(name))
    text = kernel.ir("ptx", arch=80)
    assert "sin.approx" in text and ".maxntid 64" in text
    assert wp.get_module_options(wp.get_module(name))["block_dim"] == 64
    wp.set_module_options({"fast_math": False, "mode": "debug"}, wp.get_module(name))
    text = kernel.ir("ptx", arch=80)
    assert "sin.approx" not in text and "atom" in text
    wp.set_module_options({"mode": "release", "optimization_level": 0}, wp.get_module(name))
    assert kernel.ir("ptx", arch=80) != text


@wp.kernel(module="options_load")
def double(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 2.0 * x[i]


@wp.kernel(module="options_load")
def halve(x: wp.array2d(dtype=float)):
    i, j = wp.tid()
    x[i, j] = 0.5 * x[i, j]


@pytest.mark.parametrize("workers", [0, 4])
def test_loading_compiles(device, workers):
    wp.get_module("options_load").mark_modified()
    wp.load_module("options_load", device=device, max_workers=workers)
    before = [k.native.compile_times() for k in (double, halve)]
    assert all(times["load"] > 0 for times in before)
    x = wp.ones((4, 4), dtype=float, device=device)
    wp.launch(halve, (4, 4), [x], device=device)
    wp.launch(double, 16, [x.flatten()], device=device)
    assert x.numpy().sum() == 16
    assert [k.native.compile_times() for k in (double, halve)] == before
    wp.force_load(device, [wp.get_module("options_load")])


def test_launch_bounds_limit_launches(device):
    kernel = wp.kernel(module="options_bounds", launch_bounds=64)(math)
    x = wp.ones(100, dtype=float, device=device)
    y = wp.zeros(100, dtype=float, device=device)
    wp.launch(kernel, 100, [x, y], device=device)
    first = y.numpy()
    wp.launch(kernel, 100, [x, y], device=device, block_dim=32)
    assert (y.numpy() == first).all()
    if device == "cpu":
        return
    with pytest.raises(wp.WarpLaunchError, match="1 to 64 threads per block, but got '128'"):
        wp.launch(kernel, 100, [x, y], device=device, block_dim=128)


def test_questions_about_kernels(device):
    if device == "cpu":
        assert wp.get_suggested_block_size(double, device) == (1, 1)
        assert wp.get_suggested_block_size(of_any_type, device) == (1, 1)
        with pytest.raises(RuntimeError, match="no CUDA properties"):
            wp.get_cuda_kernel_properties(double, device)
    else:
        with pytest.raises(RuntimeError, match="is generic, its types are open"):
            wp.get_suggested_block_size(of_any_type, device)
        threads, blocks = wp.get_suggested_block_size(double, device)
        assert 32 <= threads <= 1024 and blocks >= 1
        found = wp.get_cuda_kernel_properties(double, device)
        assert 1 <= found["register_count"] <= 255 and found["local_memory_size"] == 0
        assert found["block_dim"] == 256 and 0 < found["occupancy"] <= 1
        assert found["binary_version"] // 10 == wp.get_device(device).arch // 10
        assert wp.get_cuda_kernel_properties(double, device, 64)["block_dim"] == 64
    with pytest.raises(TypeError, match="expects a kernel, but got 'function'"):
        wp.get_suggested_block_size(math, device)
    assert wp.get_cuda_max_cluster_dim(double, device) == 1
    with pytest.raises(ValueError):
        wp.get_cuda_kernel_properties(double, device, -1)


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({"cluster_dim": 17}, ValueError, "cluster_dim expects 1 to 16 blocks, but got 17"),
        ({"cluster_dim": (2, 1, 1)}, TypeError, "cluster_dim expects an int"),
        ({"enable_cuda_smem_spilling": 1}, TypeError, "expects a bool, but got 1"),
        ({"clusters": 2}, TypeError, "kernel has no option 'clusters'"),
    ],
)
def test_options_that_change_nothing_are_checked(options, kind, words):
    with pytest.raises(kind, match=words):

        @wp.kernel(**options)
        def refused(x: wp.array(dtype=float)):
            x[0] = 1.0


def test_clusters_are_told_to_be_none():
    with pytest.warns(UserWarning, match="cluster_dim=2 changes nothing") as told:

        @wp.kernel(cluster_dim=2)
        def clustered(x: wp.array(dtype=float)):
            x[0] = 1.0

    assert told[0].filename == __file__


def test_name_of_cpu_caches():
    key = wp.get_cpu_kernel_cache_key()
    assert key == wp.get_cpu_kernel_cache_key() and key.startswith(wp.__version__)
