"""The pytest suite, a process for one long or a few short files, several at a time.

    python test/device/suite.py [--jobs 8] [--timeout 200] [--log FOLDER] [files...] [-- arguments]

Prints what failed, why tests were skipped and how often, the slowest files, and as the last line
`N passed, N failed, N skipped`. A process that breaks before it counts anything is one failure.
Every process compiles into a kernel cache of its own.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# Files that take a minute and more beside others, which their sizes do not tell.
LONGEST = (
    *("test_compare", "test_failures", "test_gallery", "test_orders", "test_stokes"),
    *("test_discontinuous", "test_threads_claims", "test_derivative_rules", "test_ranks"),
    *("test_autodiff_catalogue", "test_commuting", "test_threads_programs", "test_imports"),
    *("test_magnetostatics", "test_examples", "test_tile_forms", "test_deformed"),
    *("test_threads_adjoints", "test_vector_fields", "test_search", "test_documents"),
    *("test_factored_matrices", "test_poisson", "test_bad_cache", "test_tile_adjoints"),
)
# Short files of a folder that one process runs: starting takes as long as they do.
GROUP = 4


@dataclass
class Result:
    """Outcome of one process."""

    name: str
    seconds: float = 0.0
    counts: Counter = field(default_factory=Counter)
    reasons: Counter = field(default_factory=Counter)
    failures: list = field(default_factory=list)
    output: str = ""


def read(report, result):
    """Adds what a JUnit report counts."""
    for test in ElementTree.parse(report).getroot().iter("testcase"):
        outcome = {child.tag: child for child in test}
        bad = outcome.get("failure", outcome.get("error"))
        if bad is not None:
            result.counts["failed"] += 1
            message = " ".join((bad.get("message") or "").split())
            file = (test.get("classname") or result.name).rpartition(".")[2]
            result.failures.append(f"{file}::{test.get('name')}: {message[:400]}")
        elif "skipped" in outcome:
            result.counts["skipped"] += 1
            skip = outcome["skipped"]
            reason = skip.get("message") or "no reason"
            if reason == "collection skipped":  # a whole file
                reason = f"{result.name}: {(skip.text or reason).rpartition('Skipped: ')[2]}"
            result.reasons[reason] += 1
        else:
            result.counts["passed"] += 1


def groups_of(files):
    """Lists of files for one process each, those that take longest first."""
    files = sorted(files, key=lambda path: -path.stat().st_size)
    alone = [path for name in LONGEST for path in files if path.stem == name]
    folders = {}
    for path in files:
        if path not in alone:
            folders.setdefault(path.parent, []).append(path)
    # The largest file of a folder beside its smallest.
    groups = []
    for short in folders.values():
        count = -(-len(short) // GROUP)
        groups += [short[i::count] for i in range(count)]
    groups.sort(key=lambda group: -sum(path.stat().st_size for path in group))
    return [[path] for path in alone] + groups


def run(paths, arguments, end, folder):
    """Runs the files of one process."""
    result = Result(" ".join(path.stem for path in paths))
    report = Path(folder) / f"{paths[0].stem}.xml"
    environment = dict(os.environ, PYTHONUNBUFFERED="1")
    # JAX would take most of the card from the processes beside it.
    environment["XLA_PYTHON_CLIENT_PREALLOCATE"] = "false"
    environment.pop("WARP_CACHE_PATH", None)
    command = [sys.executable, "-m", "pytest", "-q", "--no-header", "-p", "no:cacheprovider"]
    command += [f"--junitxml={report}", *map(str, paths), *arguments]
    begin = time.perf_counter()
    limit = end - begin
    if limit < 5:
        result.failures.append(f"{result.name}: not run, out of time")
        result.counts["failed"] += 1
        return result
    with open(Path(folder) / f"{paths[0].stem}.log", "w+", encoding="utf-8") as log:
        try:
            status = subprocess.run(
                command, cwd=ROOT, env=environment, stdout=log, stderr=log, timeout=limit
            ).returncode
        except subprocess.TimeoutExpired:
            status = 124
        log.seek(0)
        result.output = log.read()
    result.seconds = time.perf_counter() - begin
    if report.is_file():
        read(report, result)
    if status not in (0, 5) and not result.counts["failed"]:  # 5: nothing was collected
        result.counts["failed"] += 1
        cause = "stopped, out of time" if status == 124 else f"ends with status {status}"
        last = " ".join(result.output.split()[-40:])
        result.failures.append(f"{result.name}: {cause}: {last[-400:]}")
    return result


def main():
    """Run the files, add up."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=min(12, os.cpu_count() or 1))
    parser.add_argument("--timeout", type=float, default=200.0, help="seconds for everything")
    parser.add_argument("--log", help="folder for reports and logs")
    parser.add_argument("files", nargs="*", type=Path)
    given = sys.argv[1:]
    cut = given.index("--") if "--" in given else len(given)
    options, arguments = parser.parse_args(given[:cut]), given[cut + 1 :]
    files = options.files or sorted(ROOT.glob("test/python/*/test_*.py"))
    folder = options.log or tempfile.mkdtemp(prefix="warp-suite-")
    Path(folder).mkdir(parents=True, exist_ok=True)
    end = time.perf_counter() + options.timeout
    groups = groups_of(files)
    with ThreadPoolExecutor(options.jobs) as pool:
        results = list(pool.map(lambda paths: run(paths, arguments, end, folder), groups))
    counts, reasons = Counter(), Counter()
    for result in results:
        counts += result.counts
        reasons += result.reasons
    failures = [text for result in results for text in result.failures]
    for text in failures[:20]:
        print("FAILED", text)
    if len(failures) > 20:
        print(f"and {len(failures) - 20} more, in {folder}/failures.txt")
    if failures:
        (Path(folder) / "failures.txt").write_text("\n".join(failures) + "\n", encoding="utf-8")
    for text, count in reasons.most_common(12):
        print(f"skipped {count}: {text[:150]}")
    slow = sorted(results, key=lambda result: -result.seconds)[:4]
    print("slowest:", ", ".join(f"{result.name} {result.seconds:.0f} s" for result in slow))
    print(", ".join(f"{counts[key]} {key}" for key in ("passed", "failed", "skipped")))
    return 1 if counts["failed"] or not counts["passed"] else 0


if __name__ == "__main__":
    sys.exit(main())
