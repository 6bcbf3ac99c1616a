"""Launch hooks: what launches of some kernels do besides, and that others call none."""

import pytest

import warp as wp
from warp._src.kernels import launch
from warp._src.kernels.hooks import LaunchHook


class Counter(LaunchHook):
    role = "counter"
    has_regions = False

    def __init__(self):
        self.checked = self.placed = self.forgotten = 0

    def check(self, kernel, values, device):
        self.checked += 1
        if values[1] < 0.0:
            raise wp.WarpLaunchError(f"launch('{kernel.key}'): expects 'a' of at least 0")

    def place(self, kernel, native, dim, index, block_dim, values, recorded):
        self.placed += 1
        return native, block_dim

    def reset(self):
        self.forgotten += 1


def add(x: wp.array(dtype=float), a: float):
    x[wp.tid()] += a


@pytest.fixture
def kernel():
    return wp.Kernel(add, key="add_with_hook")


def test_each_launch_calls_the_hooks(kernel):
    hook = Counter()
    kernel.add_hook(hook)
    x = wp.zeros(4, dtype=float, device="cpu")
    for _ in range(3):
        wp.launch(kernel, 4, [x, 1.0], device="cpu")
    wp.launch(kernel, 4, [x], [2.0], device="cpu")
    with wp.Tape():
        wp.launch(kernel, 4, [x, 1.0], device="cpu")
    assert (hook.checked, hook.placed) == (5, 5)
    for _ in range(2):
        with pytest.raises(wp.WarpLaunchError, match="at least 0"):
            wp.launch(kernel, 4, [x, -1.0], device="cpu")
    assert x.numpy().tolist() == [6.0] * 4
    kernel.reset()
    assert hook.forgotten == 1 and not kernel.has_regions


def test_hooks_keep_the_fast_path(kernel, monkeypatch):
    # A tape that an earlier test left alive would still observe launches.
    monkeypatch.setattr(launch.Checked, "active", False)
    kernel.add_hook(Counter())
    x = wp.zeros(4, dtype=float, device="cpu")
    wp.launch(kernel, 4, [x, 1.0], device="cpu")
    monkeypatch.setattr(launch, "_launch_checked", None)
    wp.launch(kernel, 4, [x, 1.0], device="cpu")
    assert x.numpy().tolist() == [2.0] * 4 and kernel.hook("counter").placed == 2


def test_one_hook_of_a_role(kernel):
    first, second = Counter(), Counter()
    kernel.add_hook(first)
    kernel.add_hook(second)
    assert kernel.hooks == (second,) and kernel.hook("counter") is second
    assert kernel.hook("blocks") is None and kernel.has_regions is False
    with pytest.raises(TypeError, match="'hook' expects a launch hook, but got '3'"):
        kernel.add_hook(3)


def test_what_is_no_kernel(kernel):
    x = wp.zeros(4, dtype=float, device="cpu")
    for wrong in (add, None, 3):
        with pytest.raises(wp.WarpLaunchError, match="expects a kernel, but got"):
            wp.launch(wrong, 4, [x, 1.0], device="cpu")
    with pytest.raises(TypeError, match="expects a list as 'inputs', but got 'int'"):
        kernel.add_hook(Counter())
        wp.launch(kernel, 4, [x, 1.0], device="cpu")
        wp.launch(kernel, 4, 3, device="cpu")
