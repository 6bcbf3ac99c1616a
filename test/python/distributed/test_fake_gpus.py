"""Two ranks with GPUs, without any: messages, refusals, captures, ranks that hang or die by NCCL.

The driver of the unit tests stands for the GPUs, and MPI for the library of NCCL; communicators,
streams and the watch are the ones that GPUs have.
"""

import re
from concurrent.futures import ThreadPoolExecutor

import launcher
import pytest
import test_failures

import programs

FAKE = launcher.FOLDER / "fake_nccl.py"
FLAGS = (), ("--queued",)
FAILURES = "raise", "hang", "kill", "replay", "replay-kill"


@pytest.fixture
def fake():
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    # Other tests run beside, without that driver.
    return {"WARP_CUDA_DRIVER": str(programs.FAKE_CUDA)}


@pytest.fixture
def ranks(start, fake):
    """Runs a program on two ranks: exit codes, and all output."""

    def run(*arguments, flags=(), limit=100):
        program, *others = arguments
        where = str(launcher.FOLDER / program)
        arguments = *flags, where, *others, "--way=nccl"
        return start("mpi", 2, "fake_nccl.py", *arguments, limit=limit, **fake)

    return run


def test_messages_and_refusals(ranks):
    codes, output = ranks("movement_checks.py")
    assert codes == [0] and output.count(": null}") == 5, output


@pytest.mark.parametrize("engine", ["mpi", "gloo"])
def test_messages_of_the_host_and_captures(start, fake, engine):
    codes, output = start(engine, 2, "movement_checks.py", limit=100, **fake)
    assert not any(codes) and output.count(": null}") == 3, output


@pytest.fixture(scope="module")
def failing(request):
    """Exit codes, output and seconds from the failure to the end, for each case of this session."""
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    launcher.need("mpi")

    def run(flags, how):
        arguments = *flags, launcher.FOLDER / "failing.py", how, "--way=nccl"
        codes, output = launcher.run("mpi", 2, FAKE, *arguments, limit=100, **driver)
        return codes, output, launcher.seconds_since_failure(output)

    chosen = [
        (one.callspec.params["flags"], one.callspec.params["how"])
        for one in request.session.items
        if one.path == request.path and "failing" in one.fixturenames
    ]
    driver = {"WARP_CUDA_DRIVER": str(programs.FAKE_CUDA)}
    with ThreadPoolExecutor(3) as pool:
        # Most of their time is waiting.
        yield {one: pool.submit(run, *one) for one in chosen}


@pytest.mark.parametrize("flags", FLAGS, ids=["calls wait", "calls queue"])
@pytest.mark.parametrize("how", FAILURES)
def test_a_failing_rank_ends_the_job(failing, how, flags):
    codes, output, took = failing[flags, how].result()
    assert took < 20, f"{took} s: {output}"
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
