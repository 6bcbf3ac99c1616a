"""Reads of a few bytes that wait for a GPU let other threads of Python run."""

import threading
import time

import numpy as np
import pytest

import warp as wp

pytestmark = pytest.mark.skipif(not wp.is_cuda_available(), reason="there is no GPU")


@wp.kernel
def spin(turns: int, out: wp.array(dtype=float)):
    x = float(1.0)
    for _ in range(turns):
        x = wp.sin(x) + 1.0
    out[0] = x


def busy(turns):
    out = wp.zeros(4, dtype=float, device="cuda:0")
    wp.launch(spin, 1, [turns], [out], device="cuda:0")
    return out


def seconds(turns):
    begin = time.perf_counter()
    busy(turns).numpy()
    return time.perf_counter() - begin


@pytest.mark.parametrize("way", ["numpy", "copy"])
def test_reads_let_threads_run(way):
    seconds(1000)
    turns = int(200_000 * 0.4 / seconds(200_000))
    ticks, stop = [], threading.Event()

    def tick():
        while not stop.wait(0.005):
            ticks.append(time.perf_counter())

    thread = threading.Thread(target=tick)
    thread.start()
    try:
        out = busy(turns)
        target = wp.zeros(4, dtype=float, device="cpu")
        begin = time.perf_counter()
        if way == "numpy":
            found = out.numpy()
        else:
            wp.copy(target, out)
            wp.synchronize()
            found = target.numpy()
        end = time.perf_counter()
    finally:
        stop.set()
        thread.join()
    assert np.isfinite(found[0]) and end - begin > 0.1
    during = [one for one in ticks if begin + 0.01 < one < end - 0.01]
    assert len(during) >= 5, (end - begin, len(ticks))
