"""`found(engine, size)`: what the checks on so many ranks found; skipped where a part is absent."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support" / "ranks"))

import launcher

# One process alone, MPI, and PyTorch's gloo, which takes long to start.
RUNS = [("none", 1), ("mpi", 2), ("mpi", 3), ("mpi", 4), ("torch", 3)]


def need(engine):
    name = None if engine == "none" else launcher.missing(engine)
    if name:
        pytest.skip(f"{name} is not installed")


@pytest.fixture
def found():
    def results(engine, size):
        need(engine)
        return launcher.results(engine, size, "main.py")

    return results


@pytest.fixture
def start():
    def run(engine, size, program, *arguments, limit=60):
        need(engine)
        return launcher.run(engine, size, launcher.FOLDER / program, *arguments, limit=limit)

    return run


def pytest_generate_tests(metafunc):
    if {"engine", "size"} <= set(metafunc.fixturenames):
        ids = [f"{engine}-{size}" for engine, size in RUNS]
        metafunc.parametrize(("engine", "size"), RUNS, ids=ids)
