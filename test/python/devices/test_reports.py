"""Loggers, and times of single operations."""

import numpy as np
import pytest

import warp as wp


class Kept:
    def __init__(self):
        self.lines = []

    def debug(self, message):
        self.lines.append(("debug", message))

    def info(self, message):
        self.lines.append(("info", message))

    def warning(self, message, category=None, stacklevel=1):
        self.lines.append(("warning", message))

    def error(self, message):
        self.lines.append(("error", message))


def test_loggers_are_replaced_for_a_block(capsys):
    logger, before = Kept(), wp.get_logger()
    with wp.ScopedLogger(logger), wp.ScopedTimer("work") as timer:
        timer.extra_msg = "(twice)"
    kind, message = logger.lines[0]
    assert kind == "info" and message.startswith("work took ") and message.endswith("(twice)")
    assert wp.get_logger() is before and capsys.readouterr().out == ""
    assert isinstance(logger, wp.Logger)
    with pytest.raises(TypeError, match="must implement the Logger protocol"):
        wp.set_logger(object())
    level = wp.config.log_level
    with wp.ScopedLogLevel(wp.LOG_ERROR):
        assert wp.config.log_level == wp.LOG_ERROR
    assert wp.config.log_level == level


@wp.kernel
def double(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 2.0 * x[i]


def test_operations_on_a_gpu_are_timed(device, capsys):
    x = wp.ones(1000, dtype=float, device=device)
    y = wp.zeros_like(x)
    wp.timing_begin()
    wp.launch(double, 1000, [x], device=device)
    wp.copy(y, x)
    x.zero_()
    results = wp.timing_end()
    np.testing.assert_array_equal(y.numpy(), 2)
    names = [result.name for result in results]
    if wp.get_device(device).is_cpu:
        assert names == [] and wp.timing_end() == []
        return
    assert names == [f"forward kernel {double.key}", "memcpy DtoD", "memset"]
    kinds = [wp.TIMING_KERNEL, wp.TIMING_MEMCPY, wp.TIMING_MEMSET]
    assert [result.filter for result in results] == kinds
    assert all(0 <= result.elapsed < 1000 for result in results)
    wp.timing_print(results)
    assert capsys.readouterr().out.count("memcpy") == 2
    with wp.ScopedTimer("copy", print=False, cuda_filter=wp.TIMING_MEMCPY) as timer:
        wp.copy(y, x)
        y.zero_()
    assert [result.name for result in timer.timing_results] == ["memcpy DtoD"]


@pytest.mark.cuda
def test_a_profiler_is_told():
    with wp.ScopedCudaProfiler("cuda:0") as profiler:
        assert profiler is not None


def test_profiling_the_cpu_does_nothing():
    assert wp.cuda_profiler_start("cpu") is None and wp.cuda_profiler_stop("cpu") is None
    with wp.ScopedCudaProfiler("cpu"):
        assert (wp.zeros(2, device="cpu").numpy() == 0.0).all()
