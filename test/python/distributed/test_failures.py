"""Every failure of a rank ends the job with a message, and nothing hangs."""

import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import launcher
import pytest

import warp.distributed as wd

WORDS = {
    "raise": ("rank 1 of 2 ends all ranks", "ValueError: broken"),
    "memory": ("rank 1 of 2 ends all ranks", "out of memory"),
    # Every step is a halo and a sum.
    "hang": ("rank 0: halo (plan 1, step 4)", "rank 1 last began all_reduce (plan 2, step 3)"),
    "kill": (),
    "interrupt": ("rank 1 of 2 ends all ranks", "KeyboardInterrupt"),
    "twice": (),
    "exit": (),
    # Ranks that do not make the same calls.
    "skip": (("rank 0: all_reduce (plan 2, step 4)", "rank 1: halo (plan 1, step 5)"),),
    "order": (("rank 0: halo (plan 1, step 4)", "rank 1: all_reduce (plan 2, step 4)"),),
    "leave": ("rank 0: halo (plan 1, step 4)", "rank 1 has come to its end", "as many calls"),
    "gather": ("rank 0: gather", "all ranks are there"),
    # Steps are replays of a graph with both, by NCCL.
    "replay": (
        "rank 0: replay 3 of graph 1 with halo, all_reduce: no answer within 2 s",
        "rank 1 last began replay 2 of graph 1 with halo, all_reduce",
    ),
    "replay-kill": (),
}
ON_TORCH = ("hang", "kill", "interrupt", "twice", "skip", "order", "leave")
CASES = [("mpi", how) for how in WORDS if "replay" not in how] + [
    ("torch", how) for how in ON_TORCH
]


@pytest.fixture(scope="module")
def jobs(request):
    """Exit codes, output and seconds from the failure to the end, for each case of this session."""

    def run(engine, how):
        codes, output = launcher.run(engine, 2, launcher.FOLDER / "failing.py", how, limit=150)
        return codes, output, launcher.seconds_since_failure(output)

    chosen = [
        (one.callspec.params["engine"], one.callspec.params["how"])
        for one in request.session.items
        if one.path == request.path and "jobs" in one.fixturenames
    ]
    # Most of their time is waiting.
    with ThreadPoolExecutor(3) as mpi, ThreadPoolExecutor(2) as torch:
        pools = {"mpi": mpi, "torch": torch}
        yield {
            one: pools[one[0]].submit(run, *one) for one in chosen if not launcher.missing(one[0])
        }


@pytest.mark.parametrize(("engine", "how"), CASES)
def test_a_failing_rank_ends_the_job(jobs, engine, how):
    launcher.need(engine)
    codes, output, took = jobs[engine, how].result()
    assert took < 20, f"{took} s: {output}"
    assert any(codes), output
    assert "went on" not in output
    for words in WORDS[how]:
        # Either rank may be the first to tell.
        either = words if isinstance(words, tuple) else (words,)
        assert any(one in output for one in either), output
    if how in ("hang", "skip", "order", "gather"):
        assert "make the same calls on all ranks" in output
    if engine == "torch" and how == "kill":
        assert "rank 1 is gone" in output, output


def test_ranks_that_do_not_meet_end():
    """Another program has the port and never answers, in which PyTorch waits without a limit."""
    launcher.need("torch")
    code = "import warp.distributed as wd; wd.init('torch', timeout=1)"
    with socket.create_server(("127.0.0.1", 0)) as server:
        about = {"MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(server.getsockname()[1])}
        about |= {"WORLD_SIZE": "2", "LOCAL_WORLD_SIZE": "2", "RANK": "1", "LOCAL_RANK": "1"}
        done = subprocess.run(
            [sys.executable, "-c", code],
            env=launcher.environment(**about),
            capture_output=True,
            text=True,
            timeout=100,
        )
    where = f"rank 1: init: 2 ranks do not meet at 127.0.0.1:{about['MASTER_PORT']}"
    assert done.returncode == 1 and where in done.stderr, done.stderr
    assert "or raise `timeout`" in done.stderr


@pytest.mark.parametrize("package, name", [("mpi4py", "mpi"), ("torch", "torch")])
def test_an_absent_package_is_named_with_the_command(monkeypatch, package, name):
    monkeypatch.delitem(sys.modules, f"warp._src.distributed.{name}", raising=False)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ImportError, match=f"`wd.{name}` needs .* '{package}': pip install"):
        getattr(wd, name)()
