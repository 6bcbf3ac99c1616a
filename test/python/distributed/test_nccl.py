"""The checks on ranks that have a GPU each, by NCCL, by PyTorch's NCCL and by gloo.

Gradients and bits are those of one rank. All runs start at once, since most of their time goes
into starting and compiling; each ends within `SECONDS`, and says where it was then.
"""

import importlib.util
import os
from concurrent.futures import ThreadPoolExecutor

import launcher
import numpy as np
import pytest
import test_failures
import test_ranks

import warp as wp

SECONDS = int(os.environ.get("WARP_RANKS_SECONDS", 280))
RUNS = [("nccl", 1), ("nccl", 2), ("torch-nccl", 2), ("gloo", 2)]
# Checks of GPUs alone.
PASSING = (*test_ranks.PASSING, "messages_in_graphs", "shared_on_gpus")

pytestmark = [
    pytest.mark.skipif(not wp.is_cuda_available(), reason="there is no GPU"),
    pytest.mark.skipif(importlib.util.find_spec("torch") is None, reason="torch is not installed"),
]
# PyTorch ends ranks that do not answer in its own time.
FAILURES = [*(("nccl", how) for how in ("raise", "hang", "kill", "replay", "replay-kill")),
            ("torch-nccl", "raise"), ("torch-nccl", "kill")]  # fmt: skip
_started: dict = {}
_failing: dict = {}
_told: set = set()


def found(engine, size):
    """The facts of a run; gloo takes two ranks on one GPU, too."""
    count = wp.get_cuda_device_count()
    if size > count and engine != "gloo":
        pytest.skip(f"{size} ranks need {size} GPUs")
    if not _started:
        os.environ.setdefault("WARP_RANKS_LIMIT", "40")
        pool = ThreadPoolExecutor(len(RUNS))
        for name, ranks in RUNS:
            if ranks <= count or name == "gloo":
                _started[name, ranks] = pool.submit(
                    launcher.results, name, ranks, "main.py", limit=SECONDS
                )
    return _started[engine, size].result()


def checked(engine, size, name):
    facts = found(engine, size)
    assert name in facts, f"not reached within {SECONDS} s, after {[*facts][-1:]}"
    fact = facts[name]
    if isinstance(fact, dict) and "error" in fact:
        text = fact["error"][-2000:]
        again = text in _told
        _told.add(text)
        pytest.fail(f"as before: {text[-200:]}" if again else text, pytrace=False)
    return fact


@pytest.mark.parametrize("check", PASSING)
@pytest.mark.parametrize(("way", "ranks"), RUNS)
def test_passes_on_gpus(way, ranks, check):
    assert checked(way, ranks, check) is None


@pytest.mark.parametrize("check", test_ranks.SAME_BITS)
@pytest.mark.parametrize(("way", "ranks"), RUNS[1:])
def test_same_bits_on_gpus(way, ranks, check):
    assert checked(way, ranks, check) == checked("nccl", 1, check)


@pytest.mark.parametrize(("way", "ranks"), RUNS[1:])
def test_captures_and_gradients_of_two_gpus(way, ranks):
    both, alone = checked(way, ranks, "capture"), checked("nccl", 1, "capture")
    assert both[1] == pytest.approx(alone[1], rel=1e-6)
    both, alone = checked(way, ranks, "gradient"), checked("nccl", 1, "gradient")
    for one, other in zip(alone, both, strict=True):
        np.testing.assert_allclose(other, one, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize(("engine", "how"), FAILURES)
def test_a_failing_rank_ends_the_job_on_gpus(engine, how):
    if wp.get_cuda_device_count() < 2:
        pytest.skip("2 ranks need 2 GPUs")
    if not _failing:
        pool = ThreadPoolExecutor(len(FAILURES))
        for one in FAILURES:
            _failing[one] = pool.submit(failing, *one)
    codes, output, took = _failing[engine, how].result()
    assert took < 30, f"{took} s: {output[-2000:]}"
    assert any(codes) and "went on" not in output, output[-2000:]
    for words in test_failures.WORDS[how]:
        assert words in output, output[-2000:]
    if engine == "nccl" and "kill" in how:
        assert "rank 1 is gone" in output, output[-2000:]


def failing(engine, how):
    """Exit codes, output, and seconds from the failure to the end of all ranks."""
    program = launcher.FOLDER / "failing.py"
    codes, output = launcher.run(engine, 2, program, how, limit=90)
    return codes, output, launcher.seconds_since_failure(output)
