"""The pytest suite, one process per file, several at a time.

    python test/device/suite.py [--jobs 8] [--timeout 200] [--log FOLDER] [files...] [-- arguments]

Prints what failed, why tests were skipped and how often, the slowest files, and as the last line
`N passed, N failed, N skipped`. A file that breaks before it counts anything is one failure.
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
    *("test_autodiff_catalogue", "test_derivative_rules", "test_threads_programs"),
    *("test_threads_claims", "test_documents", "test_bad_cache", "test_tile_adjoints"),
    *("test_tile_forms", "test_search", "test_threads_adjoints", "test_translations"),
)


@dataclass
class Result:
    """Outcome of one file."""

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
            result.failures.append(f"{result.name}::{test.get('name')}: {message[:400]}")
        elif "skipped" in outcome:
            result.counts["skipped"] += 1
            skip = outcome["skipped"]
            reason = skip.get("message") or "no reason"
            if reason == "collection skipped":  # a whole file
                reason = f"{result.name}: {(skip.text or reason).rpartition('Skipped: ')[2]}"
            result.reasons[reason] += 1
        else:
            result.counts["passed"] += 1


def run(path, arguments, end, folder):
    """Runs one file."""
    result = Result(path.name)
    report = Path(folder) / f"{path.stem}.xml"
    environment = dict(os.environ, PYTHONUNBUFFERED="1")
    # JAX would take most of the card from the processes beside it.
    environment["XLA_PYTHON_CLIENT_PREALLOCATE"] = "false"
    environment.pop("WARP_CACHE_PATH", None)
    command = [sys.executable, "-m", "pytest", "-q", "--no-header", "-p", "no:cacheprovider"]
    command += [f"--junitxml={report}", str(path), *arguments]
    begin = time.perf_counter()
    limit = end - begin
    if limit < 5:
        result.failures.append(f"{path.name}: not run, out of time")
        result.counts["failed"] += 1
        return result
    with open(Path(folder) / f"{path.stem}.log", "w+", encoding="utf-8") as log:
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
        result.failures.append(f"{path.name}: {cause}: {last[-400:]}")
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
    files.sort(key=lambda path: (path.stem not in LONGEST, -path.stat().st_size))
    with ThreadPoolExecutor(options.jobs) as pool:
        results = list(pool.map(lambda path: run(path, arguments, end, folder), files))
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
