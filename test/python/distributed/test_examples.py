"""The examples run alone and on ranks, and draw their pictures."""

import importlib.util
import json
from pathlib import Path

import launcher
import pytest

FOLDER = Path(__file__).resolve().parents[3] / "examples" / "distributed"
SMALL = {
    "cylinder": ["--width", "60", "--height", "24", "--steps", "40"],
    "poisson": ["--size", "24"],
    "multigrid": ["--size", "20"],
    "heat_control": ["--size", "16", "--steps", "6", "--iterations", "4"],
    "discs": ["--count", "150", "--steps", "20"],
    "flood": ["--across", "8"],
}


def run(engine, size, name, tmp_path, *options):
    codes, output = launcher.run(
        engine, size, FOLDER / f"{name}.py", *options, "--output", tmp_path, limit=150
    )
    assert not any(codes), output[-3000:]
    picture = tmp_path / f"{name}.png"
    assert picture.read_bytes().startswith(b"\x89PNG")
    return next(line for line in output.splitlines() if "rank(s):" in line or "values," in line)


@pytest.mark.parametrize("name", SMALL)
def test_on_ranks_and_alone(tmp_path, name):
    alone = run("none", 1, name, tmp_path, *SMALL[name])
    missing = launcher.missing("mpi")
    if missing:
        pytest.skip(f"{missing} is not installed")
    on_ranks = run("mpi", 2, name, tmp_path, *SMALL[name])
    if name in ("poisson", "heat_control"):
        # The same numbers on any number of ranks.
        assert on_ranks.partition(":")[2] == alone.partition(":")[2]
    if name == "multigrid":
        _check_multigrid(alone)
        _check_multigrid(on_ranks)
    if name == "discs":
        restart = ["--restart", tmp_path / "discs", "--steps", "5"]
        assert "150 discs" in run("none", 1, name, tmp_path, *restart)


def _check_multigrid(line):
    """Each preconditioner that is there takes fewer iterations than none, to the same solution."""
    found = {}
    for part in line.partition(": ")[2].split("; "):
        name, count, *_, error = part.split()
        found[name] = int(count)
        assert float(error) < 1e-5, line
    assert "Chebyshev" in found
    # Libraries that are not installed are not there.
    wanted = {"PyAMG": "pyamg", "PETSc": "petsc4py"}
    for name, module in wanted.items():
        assert (name in found) == (importlib.util.find_spec(module) is not None), line
    assert all(count < found["none"] for name, count in found.items() if name != "none"), line


@pytest.mark.parametrize("name", ["policy", "jax_rollout", "ray_sweep"])
def test_with_other_engines(tmp_path, name):
    module = {"policy": "torch", "jax_rollout": "jax", "ray_sweep": "tqdm"}[name]
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{module} is not installed")
    options = {
        "policy": ["--worlds", "16", "--iterations", "4"],
        "jax_rollout": ["--worlds", "16", "--iterations", "4"],
        "ray_sweep": ["--values", "4"],
    }[name]
    codes, output = launcher.run(
        "none", 1, FOLDER / f"{name}.py", *options, "--output", tmp_path, limit=150
    )
    assert not any(codes), output[-3000:]
    assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    if name == "policy":
        # DDP averages gradients of ranks: those of one process.
        on_ranks = run("torch", 2, name, tmp_path, *options)
        alone = next(line for line in output.splitlines() if "rank(s):" in line)
        assert on_ranks.partition(":")[2] == alone.partition(":")[2]


def test_the_scaling_program_runs_on_cpu_ranks():
    missing = launcher.missing("mpi")
    if missing:
        pytest.skip(f"{missing} is not installed")
    program = Path(__file__).resolve().parents[2] / "device" / "scale.py"
    codes, output = launcher.run("mpi", 2, program, "--quick", limit=60)
    assert not any(codes), output[-3000:]
    rows = [json.loads(line) for line in output.splitlines() if line.startswith("{")]
    assert {row["case"] for row in rows} == {"messages", "lattice", "cg", "worlds", "discs"}
    # Five populations of four bytes cross a face cell.
    face = next(row for row in rows if row["case"] == "lattice")
    assert face["face_bytes"] == 20 * face["shape"][1] * face["shape"][2]
