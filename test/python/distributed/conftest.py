"""`found(engine, size)`: what the checks on so many ranks found; skipped where a part is absent."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "support" / "ranks"))

import launcher

# One process alone, MPI, and PyTorch's gloo.
SIZES = (4, 3, 2)
RUNS = [("none", 1), *(("mpi", size) for size in reversed(SIZES)), ("torch", 3)]


_pool = ThreadPoolExecutor(1)
_checks: dict = {}


def start_checks(engine):
    """The facts to come of an engine; one job has all sizes of MPI.

    Starting and loading kernels takes longer than most checks.
    """
    if engine not in _checks:
        arguments = {
            "none": (1, "main.py"),
            "mpi": (max(SIZES), "main.py", "--sizes=" + ",".join(map(str, SIZES))),
            "torch": (3, "main.py"),
        }
        # Each size of MPI may take as long as another engine.
        limit = 280 * (len(SIZES) if engine == "mpi" else 1)
        _checks[engine] = _pool.submit(launcher.results, engine, *arguments[engine], limit=limit)
    return _checks[engine]


def pytest_runtestloop(session):
    """Starts the checks beside the other tests of this folder, which wait most of the time."""
    if session.config.option.collectonly or hasattr(session.config, "workerinput"):
        return
    # Tests of other folders may have a fixture of this name, too.
    folder = Path(__file__).parent
    engines = {
        item.callspec.params["engine"]
        for item in session.items
        if item.path.parent == folder and "found" in getattr(item, "fixturenames", ())
    }
    # The first compiles for the others.
    for engine in ("none", "mpi", "torch"):
        if engine in engines and not launcher.missing(engine):
            start_checks(engine)


def pytest_sessionfinish():
    """Checks that have not begun do not."""
    _pool.shutdown(wait=False, cancel_futures=True)


@pytest.fixture
def found():
    def results(engine, size):
        launcher.need(engine)
        facts = start_checks(engine).result()
        if engine != "mpi" or isinstance(facts, launcher.Failed):
            return facts
        return {name[2:]: fact for name, fact in facts.items() if name[0] == str(size)}

    return results


@pytest.fixture
def start():
    def run(engine, size, program, *arguments, **options):
        launcher.need(engine)
        return launcher.run(engine, size, launcher.FOLDER / program, *arguments, **options)

    return run


def pytest_generate_tests(metafunc):
    if {"engine", "size"} <= set(metafunc.fixturenames):
        ids = [f"{engine}-{size}" for engine, size in RUNS]
        metafunc.parametrize(("engine", "size"), RUNS, ids=ids)
