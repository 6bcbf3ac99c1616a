"""Compile time, bandwidth, arithmetic, launch overhead and start-up, each with its goal.

    python benchmarks/spine.py [--device cpu] [--peer /path/to/python] [--json out.json]

Every measurement runs in a process of its own (_spine_cases.py). `--peer` names a Python that
has NVIDIA Warp: it runs the same measurements, alternating with ours, and ratios are taken
within this one run. Goals that need a peer are left out without it. Throughput is that of the
fastest pass, for ours, the peer and the limits alike, and a compile time that of the fastest of
five processes: other work on the machine can only make them worse.
"""

import argparse
import ctypes
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
CASES = HERE / "_spine_cases.py"
# Goals for one kernel in milliseconds, launch in seconds, shares as fractions.
COMPILE_GOAL = {"cpu": 20.0, "cuda": 25.0}
BANDWIDTH_GOAL = {
    "cpu": {"saxpy": 0.85, "integrate": 0.85},
    "cuda": {"saxpy": 0.78, "integrate": 0.97},
}


@dataclass
class Row:
    """One line of the table; `met` is None where there is no goal."""

    name: str
    goal: str
    measured: str
    met: bool | None = None


class Runner:
    """Starts measurements of `script`, under this Python or under the peer's."""

    def __init__(self, device, seconds, peer, script=CASES, limit=None):
        self.device, self.seconds, self.peer = device, seconds, peer
        self.script, self.limit = script, limit
        self.raw = {}

    def run(self, measurement, cache, python=sys.executable):
        """One measurement with its kernel cache in the folder `cache`."""
        command = [python, str(self.script), measurement, "--device", self.device]
        command += ["--seconds", str(self.seconds)]
        environment = os.environ | {"WARP_CACHE_PATH": str(cache)}
        if python != sys.executable:
            environment.pop("PYTHONPATH", None)
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, timeout=self.limit
        )
        if done.returncode:
            raise RuntimeError(f"measurement '{measurement}' failed:\n{done.stderr[-2000:]}")
        result = json.loads(done.stdout.splitlines()[-1])
        key = "peer" if python == self.peer else "ours"
        self.raw.setdefault(measurement, {}).setdefault(key, []).append(result)
        return result

    def repeat(self, measurement, times=3, python=sys.executable):
        """Best over processes of each rate; `launch` gives times, of which the median."""
        with tempfile.TemporaryDirectory() as cache:
            results = [self.run(measurement, cache, python) for _ in range(times)]
        return {
            key: (statistics.median if measurement == "launch" else max)(
                result[key] for result in results
            )
            for key, value in results[0].items()
            if isinstance(value, int | float)
        }


def load_native():
    """Build and load native.cpp; None without a C++ compiler."""
    compiler = next(filter(None, map(shutil.which, ("clang++-22", "clang++", "g++"))), None)
    if compiler is None:
        return None
    library = Path(tempfile.mkdtemp()) / "native.so"
    flags = ["-std=c++17", "-O3", "-march=native", "-shared", "-fPIC", "-pthread"]
    subprocess.run(
        [compiler, *flags, str(HERE / "native.cpp"), "-o", str(library), "-ldl"], check=True
    )
    native = ctypes.CDLL(str(library))
    native.triad.restype = native.bare_launch.restype = ctypes.c_double
    native.triad.argtypes = [ctypes.c_int64] + 3 * [ctypes.c_int]
    return native


def compile_rows(runner, repeats=5):
    """Cold compile and cache hit per kernel, with the time by phase of the cold ones."""
    goal = COMPILE_GOAL["cuda" if "cuda" in runner.device else "cpu"]
    cold, hit = [], []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as cache:
            cold.append(runner.run("compile", cache))
            hit.append(runner.run("compile", cache))
    peer = None
    if runner.peer:
        with tempfile.TemporaryDirectory() as cache:
            peer = runner.run("compile", cache, runner.peer)
    rows = []
    names = [name for name in cold[0] if name != "version"]
    for name in names:
        value = min(result[name]["total"] for result in cold)
        text = f"{value:.1f} ms"
        if peer:
            text += f" (peer {peer[name]['total']:.0f} ms)"
        rows.append(Row(f"cold compile, {name}", f"<= {goal:.0f} ms", text, value <= goal))
    for name in names:
        value = min(result[name]["total"] for result in hit)
        rows.append(Row(f"cache hit, {name}", "<= 3 ms", f"{value:.2f} ms", value <= 3.0))
    for name in names:
        phases = min((result[name] for result in cold), key=lambda item: item["total"])["phases"]
        if phases:
            text = ", ".join(f"{phase} {ms:.1f}" for phase, ms in phases.items())
            rows.append(Row(f"phases, {name}", "", text + " ms"))
    return rows


def cpu_bandwidth_rows(runner, native):
    """saxpy and integrate as a share of a threaded triad over as many bytes."""
    rows = []
    for measurement, label in (("streams", "large arrays"), ("cached_streams", "4 M floats")):
        ours = runner.repeat(measurement)
        peer = runner.repeat(measurement, 3, runner.peer) if runner.peer else None
        for name, goal in BANDWIDTH_GOAL["cpu"].items():
            size = int(ours[name + "_bytes"])
            ordinary, streaming = (native.triad(size, 0, 101, stream) for stream in (0, 1))
            share = ours[name] / max(ordinary, streaming)
            text = f"{share:.0%}: {ours[name] / 1e9:.1f} GB/s, triad {ordinary / 1e9:.1f}"
            text += f", with streaming stores {streaming / 1e9:.1f}"
            if peer:
                text += f"; peer {peer[name] / 1e9:.1f}"
            rows.append(Row(f"{name}, {label}, of triad", f">= {goal:.0%}", text, share >= goal))
    return rows


def cuda_bandwidth_rows(runner):
    """saxpy and integrate as a share of a copy on the device."""
    ours = runner.repeat("streams")
    rows = []
    for name, goal in BANDWIDTH_GOAL["cuda"].items():
        share = ours[name] / ours["copy"]
        text = f"{share:.1%}: {ours[name] / 1e9:.0f} GB/s, copy {ours['copy'] / 1e9:.0f}"
        rows.append(Row(f"{name} of device memcpy", f">= {goal:.0%}", text, share >= goal))
    return rows


def arithmetic_rows(runner):
    """n-body and sin·exp, and how much faster than the peer."""
    ours, peer = [], []
    with tempfile.TemporaryDirectory() as cache:
        for _ in range(3):
            ours.append(runner.run("arithmetic", cache))
            if runner.peer:
                peer.append(runner.run("arithmetic", cache + "-peer", runner.peer))
    shutil.rmtree(cache + "-peer", ignore_errors=True)
    rows = []
    for key, name in (("nbody", "n-body"), ("math", "sin·exp")):
        rate = max(result[key] for result in ours)
        text = f"{rate / 1e6:.0f} M/s"
        row = Row(f"{name} to the peer", ">= 2x", text)
        if peer:
            other = max(result[key] for result in peer)
            row.measured = f"{rate / other:.2f}x: {text}, peer {other / 1e6:.0f} M/s"
            row.met = rate >= 2.0 * other if runner.device == "cpu" else None
        rows.append(row)
    return rows


def sum_rows(runner):
    """Deterministic sums, in every run and on every device, beside atomic ones."""
    ours = runner.repeat("sums")
    rows = []
    for key, name in (("total", "16 M floats to one"), ("springs", "springs")):
        atomic = ours[f"{key}_not_guaranteed"]
        for kind in ("run_to_run", "gpu_to_gpu"):
            time = ours[f"{key}_{kind}"]
            text = f"{-1e3 * time:.2f} ms, {time / atomic:.1f}x atomics with {-1e3 * atomic:.2f} ms"
            rows.append(Row(f"{name}, {kind}", "", text))
    return rows


def launch_rows(runner, native):
    """Launch from Python with four arrays, and the bare driver launch."""
    ours = runner.repeat("launch")["median"]
    text = f"{1e6 * ours:.2f} us"
    if runner.peer:
        text += f" (peer {1e6 * runner.repeat('launch', 1, runner.peer)['median']:.2f} us)"
    if runner.device == "cpu":
        return [Row("launch, 4 arrays", "<= 2 us", text, ours <= 2e-6)]
    bare = native.bare_launch(int(runner.device.partition(":")[2] or 0), 50)
    text = f"{ours / bare:.2f}x: {text}, bare driver launch {1e6 * bare:.2f} us"
    return [Row("launch, 4 arrays, of bare launch", "<= 1.5x", text, ours <= 1.5 * bare)]


def start_rows(runner):
    """Import and first cached launch in a fresh process."""
    with tempfile.TemporaryDirectory() as cache:
        runner.run("first", cache)
        results = [runner.run("first", cache) for _ in range(5)]
    parts = {
        key: 1e3 * statistics.median(result[key] for result in results)
        for key in ("total", "numpy", "import", "driver", "launch")
    }
    text = "{total:.0f} ms: NumPy {numpy:.0f}, import {import:.0f}, driver {driver:.0f}, "
    text = (text + "first launch {launch:.0f}").format(**parts)
    return [Row("import and first cached launch", "<= 200 ms", text, parts["total"] <= 200.0)]


def show(rows):
    """The table as text."""
    marks = {True: "met", False: "MISSED", None: ""}
    names, goals = (max(len(getattr(row, key)) for row in rows) for key in ("name", "goal"))
    for row in rows:
        print(f"{row.name:{names}}  {row.goal:{goals}}  {marks[row.met]:6}  {row.measured}")
    judged = [row.met for row in rows if row.met is not None]
    print(f"{sum(judged)} of {len(judged)} goals met")


def available_devices():
    """cpu, and the first GPU where one answers."""
    import warp as wp

    return ["cpu", "cuda:0"] if wp.get_cuda_device_count() else ["cpu"]


def measure(device, options, native):
    """All wanted rows of one device, and the raw numbers."""
    runner = Runner(device, options.seconds, options.peer)
    cpu = device == "cpu"
    sections = {
        "compile": lambda: compile_rows(runner),
        "bandwidth": lambda: (
            cpu_bandwidth_rows(runner, native) if cpu else cuda_bandwidth_rows(runner)
        ),
        "math": lambda: arithmetic_rows(runner),
        "sums": lambda: sum_rows(runner),
        "launch": lambda: launch_rows(runner, native),
        "start": lambda: start_rows(runner),
    }
    wanted = options.only.split(",") if options.only else list(sections)
    rows = [row for name in wanted for row in sections[name]()]
    return rows, runner.raw


def main():
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", help="cpu or cuda:N; both where there is a GPU")
    parser.add_argument("--peer", help="Python interpreter with NVIDIA Warp installed")
    parser.add_argument("--seconds", type=float, default=1.0, help="per steady measurement")
    parser.add_argument("--only", default="", help="of compile,bandwidth,math,sums,launch,start")
    parser.add_argument("--json", help="file for the rows and all raw numbers")
    options = parser.parse_args()

    native = load_native()
    report = {}
    for device in [options.device] if options.device else available_devices():
        print(f"{device}", flush=True)
        rows, raw = measure(device, options, native)
        show(rows)
        report[device] = {"rows": [asdict(row) for row in rows], "raw": raw}
    if options.json:
        Path(options.json).write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
