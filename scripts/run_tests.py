"""Run every test suite and add up what they counted.

    run_tests.py [--only lit,roundtrip,unit,python]

Suites: lit (test/**/*.mlir and test/lit/**/*.py), lit once more with every
input passed through `--verify-roundtrip`, GoogleTest (warp-unit-tests), and
pytest, files side by side in a process per core. The last line is `N passed,
N failed, N skipped`; a suite that breaks before it counts anything adds one
failure, and what did not run is skipped.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
RESULTS = BUILD / "test-results"
TIMEOUT = 2400


@dataclass
class Count:
    """Tests by outcome."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(
            self.passed + other.passed,
            self.failed + other.failed,
            self.skipped + other.skipped,
        )

    def __str__(self) -> str:
        return f"{self.passed} passed, {self.failed} failed, {self.skipped} skipped"


def execute(command: list[str], **variables: str) -> int:
    """Run one suite's command in the repository's root; its exit status."""
    environment = os.environ | {"PYTHONPATH": str(BUILD / "python")} | variables
    try:
        return subprocess.run(command, cwd=ROOT, env=environment, timeout=TIMEOUT).returncode
    except subprocess.TimeoutExpired:
        print(f"stopped after {TIMEOUT} s: {' '.join(command)}", flush=True)
        return 124


def settle(count: Count, status: int) -> Count:
    """A non-zero exit that no counted failure explains is a failure."""
    if status != 0 and count.failed == 0:
        count.failed = 1
    return count


def run_lit(roundtrip: bool = False) -> Count:
    output = RESULTS / ("lit-roundtrip.json" if roundtrip else "lit.json")
    command = [str(Path(sys.executable).parent / "lit"), "-q", "--no-progress-bar"]
    command += [f"-j{os.cpu_count()}", "-o", str(output), str(BUILD / "test")]
    variables = {"WARP_VERIFY_ROUNDTRIP": "1"} if roundtrip else {}
    status = execute(command, **variables)
    count = Count()
    if output.is_file():
        for test in json.loads(output.read_text())["tests"]:
            if test["code"] in ("PASS", "XFAIL", "FLAKYPASS"):
                count.passed += 1
            elif test["code"] in ("UNSUPPORTED", "SKIPPED", "EXCLUDED"):
                count.skipped += 1
            else:
                count.failed += 1
    return settle(count, status)


def run_unit() -> Count:
    output = RESULTS / "unit.json"
    binary = BUILD / "bin" / "warp-unit-tests"
    if not binary.is_file():
        print(f"no '{binary.relative_to(ROOT)}'", flush=True)
        return Count(failed=1)
    status = execute([str(binary), "--gtest_brief=1", f"--gtest_output=json:{output}"])
    count = Count()
    if output.is_file():
        for suite in json.loads(output.read_text())["testsuites"]:
            for test in suite["testsuite"]:
                if test.get("failures"):
                    count.failed += 1
                elif test["result"] == "COMPLETED":
                    count.passed += 1
                else:
                    count.skipped += 1
    return settle(count, status)


def run_python() -> Count:
    output = RESULTS / "python.xml"
    command = [sys.executable, "-m", "pytest", "-q", "--no-header", f"--junitxml={output}"]
    # A process that dies is a failure and ends the suite.
    command += ["-n", str(os.cpu_count()), "--dist", "loadfile", "--max-worker-restart", "0"]
    status = execute(command)
    count = Count()
    if output.is_file():
        for test in ElementTree.parse(output).getroot().iter("testcase"):
            outcomes = {child.tag for child in test}
            if outcomes & {"failure", "error"}:
                count.failed += 1
            elif "skipped" in outcomes:
                count.skipped += 1
            else:
                count.passed += 1
    return settle(count, status)


SUITES = {
    "lit": run_lit,
    "roundtrip": lambda: run_lit(roundtrip=True),
    "unit": run_unit,
    "python": run_python,
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default=",".join(SUITES), help="suites, by comma")
    names = parser.parse_args().only.split(",")
    unknown = [name for name in names if name not in SUITES]
    if unknown:
        parser.error(f"unknown suite '{unknown[0]}', expected one of {', '.join(SUITES)}")
    RESULTS.mkdir(parents=True, exist_ok=True)
    for stale in RESULTS.iterdir():
        stale.unlink()
    total = Count()
    summary = []
    for name in names:
        print(f"== {name}", flush=True)
        start = time.perf_counter()
        count = SUITES[name]()
        total += count
        summary.append(f"{name:10} {time.perf_counter() - start:6.1f} s  ({count})")
    print("\n".join(["==", *summary]))
    print(total, flush=True)
    return 1 if total.failed or not total.passed else 0


if __name__ == "__main__":
    sys.exit(main())
