"""Steps of slices that are known at run time only: 0 is an error in any mode."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def of_one(a: wp.array(dtype=float), step: int, o: wp.array(dtype=int)):
    o[0] = a[::step].shape[0]


@wp.kernel
def of_two(a: wp.array2d(dtype=float), step: int, o: wp.array(dtype=int)):
    v = a[0:2:step]
    o[0] = int(v[0, 1])


@wp.kernel
def of_columns(a: wp.array2d(dtype=float), step: int, o: wp.array(dtype=int)):
    v = a[:, ::step]
    o[0] = int(v[0, 0])


@wp.kernel
def of_three(a: wp.array3d(dtype=float), step: int, o: wp.array(dtype=int)):
    v = a[0, ::step, 1:]
    o[0] = int(v[0, 0])


@wp.kernel
def of_four(a: wp.array4d(dtype=float), step: int, o: wp.array(dtype=int)):
    v = a[:, :, :, 5:0:step]
    o[0] = int(v[0, 0, 0, 0])


KERNELS = [of_one, of_two, of_columns, of_three, of_four]


def arrays(kernel, device):
    rank = {of_one: 1, of_two: 2, of_columns: 2, of_three: 3, of_four: 4}[kernel]
    return wp.ones((6,) * rank, dtype=float, device=device), wp.zeros(1, dtype=int, device=device)


@pytest.mark.parametrize("mode", ["release", "debug"])
@pytest.mark.parametrize("kernel", KERNELS, ids=lambda one: one.key)
def test_a_step_of_zero(device, monkeypatch, kernel, mode):
    monkeypatch.setattr(wp.config, "mode", mode)
    a, o = arrays(kernel, device)
    for step in (1, 2, -1, -3):
        if step < 0 and kernel is not of_four and kernel is not of_one:
            continue
        if step > 0 and kernel is of_four:
            continue
        wp.launch(kernel, dim=1, inputs=[a, step, o], device=device)
        expected = len(range(6)[::step]) if kernel is of_one else 1
        assert o.numpy()[0] == expected
    with pytest.raises(wp.WarpLaunchError, match="slice step is zero") as caught:
        wp.launch(kernel, dim=1, inputs=[a, 0, o], device=device)
        wp.synchronize()
    line = kernel.func.__code__.co_firstlineno + 2
    assert f"test_slice_steps.py:{line}" in str(caught.value), caught.value
    # A launch that fails leaves nothing behind.
    step = -1 if kernel is of_four else 1
    wp.launch(kernel, dim=1, inputs=[a, step, o], device=device)
    wp.synchronize()


@wp.kernel
def each_thread(a: wp.array(dtype=float), steps: wp.array(dtype=int), o: wp.array(dtype=int)):
    i = wp.tid()
    if steps[i] != 0:
        o[i] = a[:: steps[i]].shape[0]


def test_slices_that_are_not_taken(device):
    """A check under a condition runs under it."""
    steps = np.array([1, 0, 2, -3, 0, 7] * 50, dtype=np.int32)
    o = wp.full(steps.size, -1, dtype=int, device=device)
    a = wp.zeros(10, dtype=float, device=device)
    wp.launch(each_thread, dim=steps.size, inputs=[a, wp.array(steps, device=device), o],
              device=device)  # fmt: skip
    wp.synchronize()
    expected = [len(range(10)[::s]) if s else -1 for s in steps]
    np.testing.assert_array_equal(o.numpy(), expected)


@wp.kernel
def in_a_loop(a: wp.array(dtype=float), count: int, step: int, o: wp.array(dtype=int)):
    for _k in range(count):
        o[0] += a[::step].shape[0]


def test_loops_that_run_never(device):
    o, a = wp.zeros(1, dtype=int, device=device), wp.zeros(10, dtype=float, device=device)
    wp.launch(in_a_loop, dim=1, inputs=[a, 0, 0, o], device=device)
    wp.launch(in_a_loop, dim=1, inputs=[a, 3, 2, o], device=device)
    wp.synchronize()
    assert o.numpy()[0] == 15
    with pytest.raises(wp.WarpLaunchError, match="slice step is zero"):
        wp.launch(in_a_loop, dim=1, inputs=[a, 1, 0, o], device=device)
        wp.synchronize()


def test_recorded_launches_and_graphs():
    """Late checks report, too."""
    a, o = wp.zeros(6, dtype=float, device="cpu"), wp.zeros(1, dtype=int, device="cpu")
    recorded = wp.launch(of_one, dim=1, inputs=[a, 2, o], device="cpu", record_cmd=True)
    recorded.launch()
    assert o.numpy()[0] == 3
    recorded.set_param_at_index(1, 0)
    with pytest.raises(wp.WarpLaunchError, match="slice step is zero"):
        recorded.launch()
    with wp.ScopedCapture(device="cpu") as capture:
        wp.launch(of_one, dim=1, inputs=[a, 0, o], device="cpu")
    for _ in range(2):
        with pytest.raises(wp.WarpLaunchError, match="slice step is zero"):
            wp.capture_launch(capture.graph)


def test_code_for_a_gpu():
    """Code reports it, where a step may be zero."""
    assert "warp_report" in of_one.ir("ptx", arch=90)


@wp.kernel
def of_a_constant(a: wp.array(dtype=float), o: wp.array(dtype=int)):
    o[0] = a[::2].shape[0]


def test_known_steps_cost_nothing():
    assert "warp_report" not in of_a_constant.ir("ptx", arch=90)
