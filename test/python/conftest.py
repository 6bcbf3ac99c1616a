"""Shared fixtures.

`device` runs a test once per device: "cpu", and "cuda:0" where one answers.
WARP_TEST_DEVICE="cuda:0" (or a comma-separated list) overrides the choice.
Tests marked `cuda` are skipped, and counted so, where there is no device.
WARP_TEST_LEVEL is the optimization level of kernels that ask for none: with one
there is no tier-0 code.
Every session compiles into its own empty kernel cache.
"""

import os
import shutil
import signal
import tempfile

import pytest

if "WARP_CACHE_PATH" not in os.environ:
    cache = tempfile.TemporaryDirectory(prefix="warp-test-cache-")
    os.environ["WARP_CACHE_PATH"] = cache.name

# A process in the background of a shell ignores Ctrl-C, and so would the programs that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

import warp as wp  # noqa: E402  (reads WARP_CACHE_PATH)
from warp import _native  # noqa: E402
from warp._src.kernels import native_code  # noqa: E402


def has_cuda() -> bool:
    return wp.get_cuda_device_count() > 0


def devices() -> list[str]:
    chosen = os.environ.get("WARP_TEST_DEVICE")
    if chosen:
        return chosen.split(",")
    return ["cpu", "cuda:0"] if has_cuda() else ["cpu"]


@pytest.fixture
def native_device(device):
    """The current device is `device`, for which native code can be compiled."""
    gpu = device != "cpu"
    if not native_code.compiler(gpu):
        pytest.skip("no NVRTC" if gpu else "no Clang")
    with wp.ScopedDevice(device):
        yield device


def pytest_generate_tests(metafunc):
    if "device" in metafunc.fixturenames:
        metafunc.parametrize("device", devices())


def pytest_collection_modifyitems(items):
    if has_cuda():
        return
    skip = pytest.mark.skip(reason="no CUDA device")
    for item in items:
        if "cuda" in item.keywords:
            item.add_marker(skip)


@pytest.fixture
def two_devices():
    """Two CUDA devices; a test that asks for them is skipped where there are fewer."""
    if wp.get_cuda_device_count() < 2:
        pytest.skip("fewer than two CUDA devices")
    return "cuda:0", "cuda:1"


@pytest.fixture
def fresh_cache(tmp_path, monkeypatch):
    """An empty kernel cache folder for this test and its child processes."""
    folder = tmp_path / "kernel-cache"
    # Kernels that other tests have asked for go elsewhere.
    _native.wait_for_background()
    monkeypatch.setenv("WARP_CACHE_PATH", str(folder))
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(folder))
    yield folder
    _native.wait_for_background()


@pytest.fixture(scope="session", autouse=True)
def no_notices():
    wp.config.quiet = True
    if "WARP_TEST_LEVEL" in os.environ:
        wp.config.optimization_level = int(os.environ["WARP_TEST_LEVEL"])


@pytest.fixture
def config():
    """The settings, put back after the test."""
    saved = {name: getattr(wp.config, name) for name in dir(wp.config)}
    yield wp.config
    for name, value in saved.items():
        if getattr(wp.config, name) != value:
            setattr(wp.config, name, value)


@pytest.fixture(scope="module")
def browser():
    """Headless Chromium, the system's or playwright's."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as running:
        options = {"args": ["--use-gl=angle", "--use-angle=swiftshader", "--no-sandbox"]}
        system = shutil.which("chromium") or shutil.which("google-chrome")
        try:
            found = running.chromium.launch(executable_path=system, **options)
        except playwright.Error:
            pytest.skip("Chromium is not installed: playwright install chromium")
        yield found
        found.close()
