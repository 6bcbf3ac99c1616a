"""Gradients: the catalogue of cases, time of backward launches, and what they consist of.

    python benchmarks/autodiff.py [--device cpu] [--peer /path/to/python] [--json out.json]

The sections are `catalogue` (numbered cases with expected gradients, in test/python/support),
`time` (backward over forward), `directions` (tangents over forward), `compile`, `loops` (a million
iterations backwards, many shorter loops, random samples) and `precision` (error beside time, of a
stiff and an extreme case). `--peer` names a Python that has NVIDIA Warp: it runs the same cases,
and ratios are taken within this run. Every measurement runs in a process of its own; a case that
ends its process counts as failed, and the next one begins in a new process.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
from dataclasses import asdict
from pathlib import Path

import spine
from spine import Row, Runner

HERE = Path(__file__).resolve().parent
TESTS = HERE.parent / "test" / "python" / "support"
sys.path.insert(0, str(TESTS))
# Backward over forward.
RATIO_GOALS = {"saxpy": 1.5, "springs": 1.5}
RATIO_GOAL = 2.5
VERDICTS = {
    "exact": "passed",
    "error": "located error as specified",
    "failed": "failed",
    "not there": "not there",
}
LIMIT = 900.0
# Seconds for one case.
CASE_LIMIT = 120


def list_catalogue():
    """Numbers of the cases that there are, and of those without a subject."""
    from autodiff_catalogue import ABSENT, CASES

    return sorted(CASES, key=lambda number: int(number[1:])), ABSENT


def start_catalogue(python, device, after, cache):
    """Runs cases until the end or until one ends the process; the lines printed."""
    command = [python, "-m", "autodiff_catalogue", "--device", device, "--after", after]
    command += ["--limit", str(CASE_LIMIT)]
    environment = os.environ | {"WARP_CACHE_PATH": cache}
    if python != sys.executable:
        environment.pop("PYTHONPATH", None)
    elif "PYTHONPATH" in environment:
        # It may be relative to where this runs.
        folders = environment["PYTHONPATH"].split(os.pathsep)
        environment["PYTHONPATH"] = os.pathsep.join(map(os.path.abspath, folders))
    try:
        done = subprocess.run(
            command, cwd=TESTS, env=environment, capture_output=True, text=True, timeout=LIMIT
        )
        text, status = done.stdout, f"the process ended with status {done.returncode}"
        status = "no end within the time limit" if done.returncode == -signal.SIGALRM else status
    except subprocess.TimeoutExpired as late:
        text, status = (late.stdout or b"").decode(), "no end within the time limit"
    lines = [json.loads(line) for line in text.splitlines() if line.startswith('{"')]
    return lines, status


def run_catalogue(python, device):
    """Per run, as "T1/float32", its verdict and text."""
    results, after = {}, ""
    with tempfile.TemporaryDirectory() as cache:
        while True:
            lines, status = start_catalogue(python, device, after, cache)
            results |= {line["end"]: line for line in lines if "end" in line}
            if not lines or "end" in lines[-1]:
                return results
            after = lines[-1]["begin"]
            results[after] = {"verdict": "failed", "text": status}


def verdict_of(number, results):
    """The verdict of a case: that of its runs if all pass, else the text of the first failure."""
    runs = {name: item for name, item in results.items() if name.partition("/")[0] == number}
    for name, item in runs.items():
        if item["verdict"] == "failed":
            return "failed", f"{name.partition('/')[2]}: {item['text'].splitlines()[0]}"
    if not runs:
        return "failed", "not run"
    return next((item["verdict"], item["text"]) for item in runs.values())


def summary(verdicts):
    """How many cases have each verdict, as text."""
    found = [verdict for verdict, _ in verdicts.values()]
    return ", ".join(f"{text} {found.count(key)}" for key, text in VERDICTS.items())


def catalogue_rows(runner):
    """The catalogue under this package, and beside it under the peer."""
    numbers, absent = list_catalogue()
    columns = {"ours": sys.executable} | ({"peer": runner.peer} if runner.peer else {})
    tables = {}
    for name, python in columns.items():
        results = run_catalogue(python, runner.device)
        runner.raw.setdefault("catalogue", {})[name] = results
        tables[name] = {number: verdict_of(number, results) for number in numbers}
        tables[name] |= {number: ("not there", why) for number, why in absent.items()}
    failed = [number for number in numbers if tables["ours"][number][0] == "failed"]
    rows = [
        Row(
            "catalogue",
            "none fails",
            f"{summary(tables['ours'])} of {len(tables['ours'])}",
            not failed,
        )
    ]
    if runner.peer:
        rows.append(Row("catalogue, peer", "", f"{summary(tables['peer'])}"))
        right = [n for n, (verdict, _) in tables["peer"].items() if verdict != "failed"]
        behind = [number for number in right if number in failed]
        rows.append(
            Row("cases only the peer passes", "none", ", ".join(behind) or "none", not behind)
        )
    for number in failed:
        rows.append(Row(f"failed: {number}", "", tables["ours"][number][1][:160]))
    for number, (verdict, why) in tables["ours"].items():
        if verdict == "not there":
            rows.append(Row(f"not there: {number}", "", why))
    return rows


def describe(counted):
    """Counts of an adjoint as text."""
    names = ("atomics", "block_reductions", "tape_bytes", "replay_loops")
    words = [f"{counted[name]} {name.replace('_', ' ')}" for name in names if name in counted]
    return ", ".join(words)


def best_ratio(results, name):
    """The smallest forward and backward times of a kernel over several processes."""
    good = [result[name] for result in results if "error" not in result[name]]
    if not good:
        return None, results[0][name]["error"]
    return [min(item[key] for item in good) for key in ("forward", "backward")], good[0]["counts"]


def time_rows(runner):
    """Backward over forward time, and what each adjoint consists of."""
    ours, peer = [], []
    with tempfile.TemporaryDirectory() as cache, tempfile.TemporaryDirectory() as other:
        for _ in range(3):
            ours.append(runner.run("ratios", cache))
            if runner.peer:
                peer.append(runner.run("ratios", other, runner.peer))
    rows = []
    for name in (key for key in ours[0] if key != "version"):
        goal = RATIO_GOALS.get(name, RATIO_GOAL)
        times, counted = best_ratio(ours, name)
        label = f"backward over forward, {name}"
        if times is None:
            rows.append(Row(label, f"<= {goal:g}x", counted, False))
            continue
        ratio = times[1] / times[0]
        text = f"{ratio:.2f}x: {1e3 * times[0]:.3g} and {1e3 * times[1]:.3g} ms"
        if peer:
            theirs, problem = best_ratio(peer, name)
            if theirs:
                text += f"; peer {theirs[1] / theirs[0]:.2f}x: {1e3 * theirs[1]:.3g} ms backward"
            else:
                text += f"; peer {problem}"
        rows.append(Row(label, f"<= {goal:g}x", text, ratio <= goal))
        if counted:
            rows.append(Row(f"adjoint, {name}", "", describe(counted)))
    return rows


def direction_rows(runner):
    """Time per direction of forward mode, over that of the launch without tangents."""
    with tempfile.TemporaryDirectory() as cache:
        result = runner.run("directions", cache)
    rows = []
    for name, times in result.items():
        if name == "version":
            continue
        forward = times.pop("forward")
        text = ", ".join(
            f"{time / int(width) / forward:.2f}x for {width}" for width, time in times.items()
        )
        rows.append(Row(f"tangent per direction over forward, {name}", "", text))
    return rows


def compile_rows(runner, repeats=5):
    """First adjoint launch over first forward launch, with empty caches."""
    results = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as cache:
            results.append(runner.run("compile", cache))
    rows = []
    for name in (key for key in results[0] if key != "version"):
        good = [result[name] for result in results if "error" not in result[name]]
        label = f"adjoint compile, {name}"
        if not good:
            rows.append(Row(label, "<= 2x", results[0][name]["error"], False))
            continue
        forward, adjoint = (min(item[key] for item in good) for key in ("forward", "adjoint"))
        text = f"{adjoint / forward:.2f}x: {forward:.1f} and {adjoint:.1f} ms"
        rows.append(Row(label, "<= 2x", text, adjoint <= 2.0 * forward))
    return rows


def describe_loop(item):
    """Times and memory of a loop, backwards, as text."""
    text = f"{item['backward'] / item['forward']:.1f}x forward ({item['backward']:.3f} s)"
    text += f", {item['kilobytes']} kB more memory"
    names = {
        "tape_bytes": "B per thread",
        "tape_bytes_per_trip": "B per trip",
        "replay_loops": "replays",
    }
    kept = [f"{item['counts'][key]} {word}" for key, word in names.items() if key in item["counts"]]
    return ", ".join([text, *kept])


def loop_rows(runner):
    """A million iterations backwards, against float64, in fixed memory unless a tape is asked for;
    many shorter loops, and loops over random samples."""
    rows = []
    columns = {"": sys.executable} | ({", peer": runner.peer} if runner.peer else {})
    bounds = {"float32": 0.25, "float64": 1e-9}
    for suffix, python in columns.items():
        with tempfile.TemporaryDirectory() as cache:
            result = runner.run("iterations", cache, python)
        exact = result["reference"]
        for label, item in result["long"].items():
            real, _, tape = label.partition(",")
            error, bound = abs(item["gradient"] - exact) / abs(exact), bounds[real]
            met = error <= bound and (bool(tape) or item["kilobytes"] <= 4096)
            goal = f"<= {bound:g}" + ("" if tape else ", 4 MB")
            text = f"error {error:.1e}, {describe_loop(item)}"
            name = f"10^6 iterations, {label}{suffix}"
            rows.append(Row(name, "", text) if suffix else Row(name, goal, text, met))
        for label, item in (result["many"] | result["samples"]).items():
            rows.append(Row(label + suffix, "", describe_loop(item)))
    return rows


def precision_rows(runner):
    """Gradient error beside time."""
    columns = {"": sys.executable} | ({", peer": runner.peer} if runner.peer else {})
    found = {}
    for suffix, python in columns.items():
        with tempfile.TemporaryDirectory() as cache:
            found[suffix] = runner.run("precision", cache, python)
    rows = []
    for kind in ("stiff", "extreme"):
        for label in found[""][kind]:
            for suffix, result in found.items():
                item = result[kind][label]
                text = f"error {item['error']:.1e}, {1e6 * item['seconds']:.0f} us"
                if "worst" in item:
                    text += f", worst {item['worst']:.1e}"
                rows.append(Row(f"{kind}, {label}{suffix}", "", text))
    return rows


SECTIONS = {
    "catalogue": catalogue_rows,
    "time": time_rows,
    "directions": direction_rows,
    "compile": compile_rows,
    "loops": loop_rows,
    "precision": precision_rows,
}


def main():
    """Parse the command line, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", help="cpu or cuda:N; both where there is a GPU")
    parser.add_argument("--peer", help="Python interpreter with NVIDIA Warp installed")
    parser.add_argument("--seconds", type=float, default=1.0, help="per steady measurement")
    parser.add_argument("--only", default="", help="sections: " + ",".join(SECTIONS))
    parser.add_argument("--json", help="file for the rows and all raw numbers")
    options = parser.parse_args()
    wanted = options.only.split(",") if options.only else list(SECTIONS)
    report = {}
    for device in [options.device] if options.device else spine.available_devices():
        print(device, flush=True)
        runner = Runner(device, options.seconds, options.peer, HERE / "_autodiff_cases.py", LIMIT)
        rows = []
        for name in wanted:
            try:
                rows += SECTIONS[name](runner)
            except Exception as problem:
                last = str(problem).strip().splitlines()[-1:]
                rows.append(Row(name, "", f"not measured: {' '.join(last)[:160]}", False))
        spine.show(rows)
        report[device] = {"rows": [asdict(row) for row in rows], "raw": runner.raw}
    if options.json:
        Path(options.json).write_text(json.dumps(report, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
