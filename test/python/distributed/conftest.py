"""`found(engine, size)`: what the checks on so many ranks found; skipped where a part is absent."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support" / "ranks"))

import launcher

# One process alone, MPI, and PyTorch's gloo.
SIZES = (4, 3, 2)
RUNS = [("none", 1), *(("mpi", size) for size in reversed(SIZES)), ("torch", 3)]


@pytest.fixture
def found():
    def results(engine, size):
        launcher.need(engine)
        if engine != "mpi":
            return launcher.results(engine, size, "main.py")
        # One job of all sizes: starting and loading kernels takes longer than most checks.
        found = launcher.results(
            engine, max(SIZES), "main.py", "--sizes=" + ",".join(map(str, SIZES))
        )
        if isinstance(found, launcher.Failed):
            return found
        return {name[2:]: fact for name, fact in found.items() if name[0] == str(size)}

    return results


@pytest.fixture
def start():
    def run(engine, size, program, *arguments, limit=60):
        launcher.need(engine)
        return launcher.run(engine, size, launcher.FOLDER / program, *arguments, limit=limit)

    return run


def pytest_generate_tests(metafunc):
    if {"engine", "size"} <= set(metafunc.fixturenames):
        ids = [f"{engine}-{size}" for engine, size in RUNS]
        metafunc.parametrize(("engine", "size"), RUNS, ids=ids)
