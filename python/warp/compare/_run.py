"""A comparison: references, a process for each package and program, records."""

import contextlib
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from warp.compare._programs import PROGRAMS, make_inputs, reference
from warp.report._records import provenance
from warp.report._run import Progress

WORKER = Path(__file__).with_name("_worker.py")
#: Packages: the file in `packages` that has their programs, and modules of which one is imported.
PACKAGES = {
    "warp-mlir": ("warp", ()),
    "peer": ("warp", ()),
    "drjit": ("drjit", ("drjit",)),
    "jax": ("jax", ("jax",)),
    "numba": ("numba", ("numba",)),
    "taichi": ("taichi", ("quadrants", "taichi")),
    "torch": ("torch", ("torch",)),
}
OWN = "warp-mlir"


def interpreters(given):
    """The interpreter of each package that can be run, this one's packages without being asked.

    Args:
        given: interpreters by package; "peer" has no other way.

    Raises:
        ValueError: no package of that name, no such interpreter.
    """
    found = {OWN: sys.executable}
    for name, (_, modules) in PACKAGES.items():
        if name in given:
            # An interpreter of an environment is a link that must not be followed.
            found[name] = os.path.abspath(given[name])
            if not os.access(found[name], os.X_OK):
                raise ValueError(f"no interpreter '{given[name]}' for '{name}'")
        elif any(importlib.util.find_spec(module) for module in modules):
            found[name] = sys.executable
    unknown = sorted(set(given) - set(PACKAGES))
    if unknown:
        known = ", ".join(f"'{name}'" for name in PACKAGES)
        raise ValueError(f"no package '{unknown[0]}'; there are {known}")
    return found


def _environment(package, folder):
    """Variables of a process: empty caches, and of this package's path nothing for others."""
    found = {key: value for key, value in os.environ.items() if key != "WARP_CACHE_PATH"}
    if package != OWN:
        found.pop("PYTHONPATH", None)
    caches = {"WARP_CACHE_PATH": "warp", "NUMBA_CACHE_DIR": "numba", "XDG_CACHE_HOME": "cache"}
    found |= {name: str(Path(folder) / part) for name, part in caches.items()}
    return found | {"HOME": str(folder), "XLA_PYTHON_CLIENT_PREALLOCATE": "false"}


def _ask(package, python, program, device, file, repeats, budget, limit):
    """The record of one process; 'failed' or 'timeout' where it gave none."""
    command = [python, str(WORKER), PACKAGES[package][0], program, device, file]
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(
                [*command, str(repeats), str(budget)],
                env=_environment(package, folder),
                cwd=folder,
                capture_output=True,
                text=True,
                timeout=limit,
            )
        except subprocess.TimeoutExpired:
            return {"status": "timeout", "reason": f"did not end within {limit:g} s"}
    lines = done.stdout.strip().splitlines()
    with contextlib.suppress(IndexError, json.JSONDecodeError):
        return json.loads(lines[-1])
    said = (done.stderr.strip().splitlines() or [""])[-1]
    return {"status": "failed", "reason": f"exit status {done.returncode}: {said}"[:300]}


def compare(
    programs=None, *, device="cpu", pythons=None, quick=False, repeats=20, budget=0.5, limit=120.0
):
    """Measure programs by every package that can be run.

    Args:
        programs: names, all by default.
        device: 'cpu' or 'cuda:0'.
        pythons: interpreters by package ('peer', 'jax', ...); packages of this interpreter need
            none.
        quick: small sizes.
        repeats, budget: timed runs of a program at most, and seconds that they take about.
        limit: seconds that a process may take.

    Returns:
        The circumstances of the run, and a list of records.

    Raises:
        ValueError: no program or package of that name.
    """
    found = interpreters(pythons or {})
    names = list(programs or PROGRAMS)
    for name in names:
        if name not in PROGRAMS:
            known = ", ".join(f"'{key}'" for key in PROGRAMS)
            raise ValueError(f"no program '{name}'; there are {known}")
    head = provenance([device]) | {"kind": "compare", "quick": quick, "device": device}
    records, progress = [], Progress(len(names) * len(found))
    which = 0 if quick else 2 if device.startswith("cuda") else 1
    for name in names:
        size = PROGRAMS[name].sizes[which]
        inputs = make_inputs(name, size)
        with tempfile.TemporaryDirectory() as folder:
            file = str(Path(folder) / "inputs.npz")
            stored = {f"in_{key}": value for key, value in inputs.items()}
            np.savez(file, **stored, **reference(name, inputs))
            for package, python in found.items():
                record = {"program": name, "package": package, "size": size}
                asked = _ask(package, python, name, device, file, repeats, budget, limit)
                records.append(record | asked)
                progress.step(f"{name} {package}")
                head["load"] = max(head.get("load", 0.0), os.getloadavg()[1])
    return head, records
