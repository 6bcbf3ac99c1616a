#!/usr/bin/env python3
"""Seconds from programs of growing length to their code, by phase.

    compile.py [--python PYTHON] [--package FOLDER] [--peer PYTHON] [--target cpu|sm_90]
               [--kernels N] [--levels N ...]

A program is a tree of functions: each level has a function of 24 lines that calls the one before
twice, so that the copies of all calls would double with each level, and each kernel calls the last.
A row has the lines of the program, seconds of processors for all of it, wall time, milliseconds for
a line, and seconds of each phase: the front end, the way to optimised LLVM IR, and that way once
more and on to assembly or PTX. `--peer` names a Python with the peer, whose row has the whole
alone. Every program runs in a process of its own with an empty kernel cache. The last line has the
growth of the text and of the time from the shortest to the longest program: equal numbers are
linear growth.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

FUNCTION = '''
@wp.func
def level_{n}(p: wp.vec3, table: wp.array(dtype=wp.vec3), k: int):
    """Rotates, clamps and mixes a point with an entry of a table."""
    q = table[(k * {odd}) % table.shape[0]]
    axis = wp.normalize(p + 0.5 * q)
    angle = wp.length(p) * 0.{odd}
    turned = wp.quat_rotate(wp.quat_from_axis_angle(axis, angle), q)
    frame = wp.outer(axis, turned) + wp.identity(n=3, dtype=float)
    sign = float(1.0)
    if wp.dot(frame * p, q) < 0.0:
        sign = -1.0
        turned = wp.cross(axis, turned)
    limit = wp.vec3(0.0)
    for c in range(3):
        if turned[c] > limit[c]:
            limit[c] = turned[c] * sign
        else:
            limit[c] = wp.sin(p[c]) * 0.25
    mixed = frame * (p * 0.5 + limit * 0.125)
    if wp.length(mixed) > 4.0:
        mixed = wp.normalize(mixed) * 4.0
    left = {callee}(mixed, table, k + 1)
    right = {callee}(mixed - limit, table, k + {odd})
    return left * 0.5 + wp.cw_mul(right, axis) * sign
'''

KERNEL = """
@wp.kernel
def kernel_{k}(points: wp.array(dtype=wp.vec3), table: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    points[i] = level_{last}(points[i] * 1.{k}, table, i)
"""


def program(levels: int, kernels: int) -> str:
    """The text of a program."""
    text = "import warp as wp\n\n\n@wp.func\n"
    text += "def level_0(p: wp.vec3, table: wp.array(dtype=wp.vec3), k: int):\n    return p\n\n"
    for n in range(1, levels + 1):
        text += FUNCTION.format(n=n, odd=2 * n + 1, callee=f"level_{n - 1}")
    return text + "".join(KERNEL.format(k=k, last=levels) for k in range(kernels))


CHILD = """
import importlib.util, json, sys, time
path, target, is_peer = sys.argv[1], sys.argv[2], sys.argv[3] == "peer"
import warp as wp
wp.config.quiet = True
wp.config.optimization_level = 2
wp.init()
specification = importlib.util.spec_from_file_location("program", path)
module = importlib.util.module_from_spec(specification)
sys.modules["program"] = module
specification.loader.exec_module(module)
kernels = [value for name, value in vars(module).items() if name.startswith("kernel_")]
if not is_peer:
    # Loads the compiler, which is not of the program.
    @wp.kernel
    def empty(): pass
    wp.launch(empty, 1, device="cpu")
wall, used, phases = time.perf_counter(), time.process_time(), {}
def add(phase, seconds):
    phases[phase] = phases.get(phase, 0.0) + seconds
if is_peer:
    kernels[0].module.load(wp.get_device("cpu" if target == "cpu" else "cuda:0"))
else:
    arch = 0 if target == "cpu" else int(target[3:])
    for kernel in kernels:
        begin = time.process_time()
        native = kernel.prepare()
        middle = time.process_time()
        native.ir("llvm", arch)
        last = time.process_time()
        native.ir("ptx" if arch else "asm", arch)
        add("front end", middle - begin)
        add("to LLVM, optimised", last - middle)
        add("the same and to text", time.process_time() - last)
print(json.dumps({"seconds": time.process_time() - used, "wall": time.perf_counter() - wall,
                  "phases": phases}))
"""


def run(python, package, path, target, role):
    """The report of a process that compiles a program with an empty cache; None if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "WARP_CACHE_PATH": folder}
        environment.pop("PYTHONPATH", None)
        if package:
            environment["PYTHONPATH"] = package
        done = subprocess.run(
            [python, "-c", CHILD, str(path), target, role],
            env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
    if done.returncode != 0:
        print(done.stderr.strip().splitlines()[-1:], file=sys.stderr)
        return None
    return json.loads(done.stdout.strip().splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    default = Path(__file__).resolve().parents[1] / "build" / "python"
    parser.add_argument("--package", default=str(default), help="folder of this package")
    parser.add_argument("--python", default=sys.executable, help="Python for this package")
    parser.add_argument("--peer", help="Python with the peer")
    parser.add_argument("--target", default="cpu", help="cpu, or the architecture for PTX: sm_90")
    parser.add_argument("--kernels", type=int, default=2)
    parser.add_argument("--levels", type=int, nargs="+", default=[4, 8, 16, 32])
    given = parser.parse_args()
    measured = []
    print(f"{'levels':>6} {'lines':>6} {'CPU s':>8} {'wall s':>8} {'ms/line':>8}  phases")
    with tempfile.TemporaryDirectory() as folder:
        for levels in given.levels:
            text = program(levels, given.kernels)
            path = Path(folder) / f"levels_{levels}.py"
            path.write_text(text)
            lines = len([line for line in text.splitlines() if line.strip()])
            for role, python in (("ours", given.python), ("peer", given.peer)):
                if not python:
                    continue
                package = given.package if role == "ours" else None
                found = run(python, package, path, given.target, role)
                if found is None:
                    continue
                seconds = found["seconds"]
                phases = ", ".join(f"{name} {one:.3f}" for name, one in found["phases"].items())
                print(
                    f"{levels:6d} {lines:6d} {seconds:8.3f} {found['wall']:8.3f} "
                    f"{1e3 * seconds / lines:8.2f}  {role}: {phases or 'all'}"
                )
                if role == "ours":
                    measured.append((lines, seconds))
    if len(measured) > 1:
        (first, least), (last, most) = measured[0], measured[-1]
        print(f"lines grow {last / first:.1f} times, seconds {most / least:.1f} times")


if __name__ == "__main__":
    main()
