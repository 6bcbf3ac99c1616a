"""Figures of a CUDA device under this package, beside its limits.

    python benchmarks/gpu.py [--device cuda:0] [--seconds 0.5] [--only streams,math] [--json out]

Limits are measured in the same run: the bare driver launch, the driver's copies, a copy on the
device, and the hand-written kernels of limits.cu where there is nvcc. Every measurement runs in a
process of its own, with a time limit; one that fails is a line of the table, and the rest goes on.
Rates are those of the fastest pass. Without a GPU only `registers` means anything.
"""

import argparse
import importlib
import json
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

import spine
from spine import Row, Runner

HERE = Path(__file__).resolve().parent
# Shares of the copy on the device.
STREAM_GOALS = {"saxpy": 0.97, "integrate": 0.95, "stencil": 0.85, "transposed copy": 0.95}
# The limit beside a row, where its name differs.
HAND_WRITTEN = {"transposed copy": "transpose", "stencil": "best stencil"}
LIMIT = 60.0


class Session:
    """Parts that the sections share: how to run a measurement, and the hand-written limits."""

    def __init__(self, device, seconds):
        self.device, self.seconds = device, seconds
        self.cases = Runner(device, seconds, None, HERE / "_gpu_cases.py", LIMIT)
        self.spine = Runner(device, seconds, None, limit=LIMIT)
        self.limits = {}

    def measure(self, name):
        """One measurement of _gpu_cases.py."""
        with tempfile.TemporaryDirectory() as cache:
            return self.cases.run(name, cache)

    def limit_rows(self):
        """Compiles and runs limits.cu; its numbers appear in the rows of other sections."""
        compiler = shutil.which("nvcc")
        if not compiler:
            return [Row("hand-written limits", "", "not run: no nvcc")]
        with tempfile.TemporaryDirectory() as folder:
            program = f"{folder}/limits"
            command = [compiler, "-O3", "-arch=native", str(HERE / "limits.cu"), "-o", program]
            subprocess.run(command, check=True, capture_output=True, timeout=LIMIT)
            done = subprocess.run([program], capture_output=True, text=True, timeout=LIMIT)
        if done.returncode:
            raise RuntimeError(f"limits.cu fails: {done.stderr[-500:]}")
        self.limits = json.loads(done.stdout)
        self.limits["best stencil"] = max(
            rate for name, rate in self.limits.items() if name.startswith("stencil")
        )
        units = {"math": "G/s", "sum": "G/s", "scatter": "G/s"}
        parts = [
            f"{name} {rate / 1e9:.4g} {units.get(name, 'GB/s')}"
            for name, rate in self.limits.items()
            if name != "launch"
        ]
        parts.append(f"launch {1e6 * self.limits['launch']:.2f} us")
        half = len(parts) // 2
        return [
            Row("hand-written limits", "", ", ".join(part)) for part in (parts[:half], parts[half:])
        ]

    def beside(self, name, unit="G/s"):
        """The hand-written limit of that name as text, if it was measured."""
        rate = self.limits.get(name)
        return f", hand-written {rate / 1e9:.0f} {unit}" if rate else ""


def launch_rows(session):
    """Launch from Python with four arrays, and the bare driver launch, taking turns."""
    native = spine.load_native()
    ordinal = int(session.device.partition(":")[2] or 0)
    bare, ours = [], []
    with tempfile.TemporaryDirectory() as cache:
        for _ in range(3):
            if native:
                bare.append(native.bare_launch(ordinal, 200))
            ours.append(session.spine.run("launch", cache)["median"])
    own = sorted(ours)[1]
    if not native or min(bare) <= 0:
        return [Row("launch, 4 arrays", "", f"{1e6 * own:.2f} us")]
    driver = sorted(bare)[1]
    text = f"{own / driver:.2f}x: {1e6 * own:.2f} us, bare driver launch {1e6 * driver:.2f} us"
    return [Row("launch, 4 arrays, of bare launch", "<= 1.4x", text, own <= 1.4 * driver)]


def stream_rows(session):
    """Kernels that read and write, as a share of a copy on the device."""
    result = session.measure("streams")
    copy = max(result["copy"], session.limits.get("copy", 0.0))
    rows = []
    for name, goal in STREAM_GOALS.items():
        share = result[name] / copy
        text = f"{share:.1%}: {result[name] / 1e9:.0f} GB/s, copy {copy / 1e9:.0f}"
        text += session.beside(HAND_WRITTEN.get(name, name), "GB/s")
        if name == "transposed copy" and result["wrong"]:
            text, share = f"wrong by {result['wrong']}", 0.0
        rows.append(Row(f"{name} of device memcpy", f">= {goal:.0%}", text, share >= goal))
    text = f"{result['transposing kernel'] / copy:.1%} of device memcpy, one item per thread"
    rows.append(Row("transposing kernel", "", text))
    return rows


def math_rows(session):
    """sin·exp: rate and error."""
    result = session.measure("math")
    rate = result["rate"]
    # The expression as a whole cancels in float32; its functions are judged.
    error = max(result[name] for name in ("sin", "exp", "log"))
    text = f"{rate / 1e9:.0f} G/s" + session.beside("math")
    parts = ", ".join(f"{name} {result[name]:.2f}" for name in ("sin", "exp", "log"))
    return [
        Row("sin·exp", ">= 250 G/s", text, rate >= 250e9),
        Row("sin·exp, largest error", "<= 2 ulp", f"{error:.2f} ulp ({parts})", error <= 2.0),
        Row("sin·exp, whole expression", "", f"{result['whole']:.1f} ulp, operands rounded"),
        Row("n-body, 16384 points", "", f"{result['nbody'] / 1e9:.0f} G pairs/s"),
    ]


def atomic_rows(session):
    """Atomic additions, to one address and to many."""
    result = session.measure("atomics")
    one = f"{result['one'] / 1e9:.1f} G/s{session.beside('sum')}, error {result['error']:.1e}"
    met = result["one"] >= 100e9 and result["error"] < 1e-4
    distinct = f"{result['distinct'] / 1e9:.1f} G/s" + session.beside("scatter")
    return [
        Row("atomic sum, one address", ">= 100 G/s", one, met),
        Row("atomic sum, distinct addresses", "", distinct),
        Row("atomic sum, 1024 addresses", "", f"{result['1024'] / 1e9:.1f} G/s"),
    ]


def transfer_rows(session):
    """Copies between host and device beside cudaMemcpyAsync and PyTorch."""
    result = session.measure("transfers")
    rows = []
    for way, name in (("up", "H2D"), ("down", "D2H")):
        ours, driver = result[f"pinned {way}"], result[f"driver {way}"]
        text = f"{ours / driver:.1%}: {ours / 1e9:.1f} GB/s, driver {driver / 1e9:.1f}"
        row = Row(f"{name} pinned, of copy engine", ">= 97%", text, ours >= 0.97 * driver)
        rows.append(row)
    for way, name in (("up", "H2D"), ("down", "D2H")):
        ours, torch = result[f"pageable {way}"], result.get(f"torch {way}")
        row = Row(f"{name} pageable, of PyTorch", ">= 97%", f"{ours / 1e9:.1f} GB/s, no PyTorch")
        if torch:
            row.measured = f"{ours / torch:.1%}: {ours / 1e9:.1f} GB/s, PyTorch {torch / 1e9:.1f}"
            row.met = ours >= 0.97 * torch
        rows.append(row)
    return rows


def register_rows(session):
    """Registers and instructions of our kernels, and of nvcc's for the same source."""
    rows = []
    for name, result in session.measure("registers").items():
        ours, nvcc = result["ours"], result.get("nvcc", {})
        used = [
            f"{what} {ours[what]}" + (f" (nvcc {nvcc[what]})" if what in nvcc else "")
            for what in ("registers", "instructions")
            if what in ours
        ]
        text = ", ".join(used).replace("instructions", "PTX instructions")
        lean = None
        if "spills" in ours:
            lean = ours["spills"] == 0 and ours["stack"] == 0
            if not lean:
                text += f", spills {ours['spills']} bytes, stack {ours['stack']} bytes"
        rows.append(Row(f"registers, {name}", "no local memory", text, lean))
    return rows


def graph_rows(session):
    """Replay of captured launches."""
    module = importlib.import_module("_gpu_graphs")
    return module.graph_rows(session.device, session.seconds)


def schedule_rows(session):
    """Launches that a schedule of their own makes faster."""
    module = importlib.import_module("_gpu_schedules")
    return module.schedule_rows(session.device, session.seconds)


SECTIONS = {
    "limits": Session.limit_rows,
    "launch": launch_rows,
    "transfers": transfer_rows,
    "streams": stream_rows,
    "math": math_rows,
    "atomics": atomic_rows,
    "graphs": graph_rows,
    "schedules": schedule_rows,
    "compile": lambda session: spine.compile_rows(session.spine, 2),
    "start": lambda session: spine.start_rows(session.spine),
    "registers": register_rows,
}


def attempt(name, session):
    """Rows of a section; a failure is a row that misses."""
    begin = time.perf_counter()
    try:
        rows = SECTIONS[name](session)
    except Exception as error:  # the other sections go on
        lines = str(error).strip().splitlines() or [type(error).__name__]
        text = " ".join(dict.fromkeys((lines[0], lines[-1])))
        rows = [Row(name, "runs", f"failed: {text}"[:300], False)]
    print(f"{name}: {time.perf_counter() - begin:.0f} s", file=sys.stderr, flush=True)
    return rows


def fill(rows, names, session, end):
    """Adds the rows of each section to `rows`, as long as there is time."""
    for name in names:
        left = end - time.perf_counter()
        if left < 0:
            rows.append(Row(name, "runs", "not run: out of time", False))
            continue
        session.cases.limit = session.spine.limit = min(LIMIT, left + 10.0)
        rows += attempt(name, session)


def main():
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--seconds", type=float, default=0.5, help="per steady measurement")
    parser.add_argument("--only", default="", help=f"sections: {','.join(SECTIONS)}")
    parser.add_argument("--budget", type=float, default=300.0, help="seconds for all sections")
    parser.add_argument("--json", help="file for the rows and all raw numbers")
    options = parser.parse_args()
    names = options.only.split(",") if options.only else list(SECTIONS)
    if unknown := [name for name in names if name not in SECTIONS]:
        parser.error(f"unknown section '{unknown[0]}', expected one of {', '.join(SECTIONS)}")
    if not options.only and options.device not in spine.available_devices():
        print(f"no '{options.device}': nothing is measured")
        return

    session = Session(options.device, options.seconds)
    rows = []
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        fill(rows, names, session, time.perf_counter() + options.budget)
    except KeyboardInterrupt:
        rows.append(Row("all sections", "run", "stopped from outside", False))
    print(options.device)
    spine.show(rows)
    if options.json:
        raw = {"limits": session.limits, "cases": session.cases.raw, "spine": session.spine.raw}
        report = {"rows": [asdict(row) for row in rows], "raw": raw}
        Path(options.json).write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
