"""Every failure of a rank ends the job with a message, and nothing hangs."""

import re
import time

import pytest

WORDS = {
    "raise": ("rank 1 of 2 ends all ranks", "ValueError: broken"),
    "memory": ("rank 1 of 2 ends all ranks", "out of memory"),
    "hang": ("rank 1 last began halo (plan 1, step 3)",),
    "kill": (),
}


CASES = [("mpi", how) for how in WORDS] + [("torch", "hang"), ("torch", "kill")]


@pytest.mark.parametrize(("engine", "how"), CASES)
def test_a_failing_rank_ends_the_job(start, engine, how):
    codes, output = start(engine, 2, "failing.py", how, limit=150)
    # Starting takes long on a busy machine and does not count.
    assert time.time() - float(re.search(r"fails at ([\d.]+)", output)[1]) < 20
    assert any(codes), output
    assert "went on" not in output
    for words in WORDS[how]:
        assert words in output, output
    if engine == "torch" and how == "kill":
        assert "rank 1 is gone" in output, output
