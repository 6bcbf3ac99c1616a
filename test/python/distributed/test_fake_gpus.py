"""Two ranks with GPUs, without any: messages, refusals, captures, ranks that hang or die by NCCL.

The driver of the unit tests stands for the GPUs, and MPI for the library of NCCL; communicators,
streams and the watch are the ones that GPUs have.
"""

import re
import time

import launcher
import pytest
import test_failures

import programs


@pytest.fixture
def fake(monkeypatch):
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    monkeypatch.setenv("WARP_CUDA_DRIVER", str(programs.FAKE_CUDA))


@pytest.fixture
def ranks(start, fake):
    """Runs a program on two ranks: exit codes, and all output."""

    def run(*arguments, flags=(), limit=100):
        program, *others = arguments
        where = str(launcher.FOLDER / program)
        return start("mpi", 2, "fake_nccl.py", *flags, where, *others, "--way=nccl", limit=limit)

    return run


def test_messages_and_refusals(ranks):
    codes, output = ranks("movement_checks.py")
    assert codes == [0] and output.count(": null}") == 4, output


@pytest.mark.parametrize("engine", ["mpi", "gloo"])
def test_messages_of_the_host_and_captures(start, fake, engine):
    codes, output = start(engine, 2, "movement_checks.py", limit=100)
    assert not any(codes) and output.count(": null}") == 3, output


@pytest.mark.parametrize("flags", [(), ("--queued",)], ids=["calls wait", "calls queue"])
@pytest.mark.parametrize("how", ["raise", "hang", "kill", "replay", "replay-kill"])
def test_a_failing_rank_ends_the_job(ranks, how, flags):
    codes, output = ranks("failing.py", how, flags=flags)
    assert time.time() - float(re.search(r"fails at ([\d.]+)", output)[1]) < 20
    assert any(codes) and "went on" not in output, output
    assert "Exception in thread" not in output, output
    for words in test_failures.WORDS[how]:
        assert words in output, output


def test_a_rank_that_does_not_join_ends_the_job(ranks):
    """The watch looks while NCCL has no communicator yet."""
    codes, output = ranks("failing.py", "stall", flags=("--stall",))
    assert any(codes) and "went on" not in output, output
    # Both ranks wait in it.
    assert re.search(r"rank \d: ncclCommInitRank .*no answer within 4 s", output), output
