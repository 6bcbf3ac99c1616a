"""A representative set of kernels and runtime calls under NVIDIA's compute-sanitizer.

    python test/device/sanitize.py [--tools memcheck,racecheck,initcheck] [--timeout 150]

Each tool first has to find a planted fault; where it cannot (no sanitizer, or one that cannot
attach to this machine's driver) it counts as not run, with the reason. Exits with 1 if a tool has
findings or the program under it fails. `sanitize.py work` is that program.
"""

import argparse
import re
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

SUMMARY = re.compile(r"(?:ERROR SUMMARY: (\d+) error|RACECHECK SUMMARY: (\d+) hazard)")
CONTROLS = {"memcheck": "wild", "initcheck": "unset"}
PROGRAM = Path(__file__).with_name("sanitize_work.py")


@dataclass
class Finding:
    """The findings of one tool in one program."""

    count: int | None  # None: the tool printed no summary
    status: int
    output: str


def inspect(tool, parts, timeout):
    """Runs the program under a tool."""
    command = ["compute-sanitizer", "--tool", tool, "--print-limit", "20", "--target-processes"]
    command += ["application-only", sys.executable, str(PROGRAM), *parts]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout)
    except subprocess.TimeoutExpired:
        return Finding(None, 124, f"stopped after {timeout:.0f} s")
    output = done.stdout + done.stderr
    counts = [int(match[1] or match[2]) for match in SUMMARY.finditer(output)]
    return Finding(sum(counts) if counts else None, done.returncode, output)


def reason(output):
    """The line that says why a tool did not start."""
    lines = [line.strip("= ") for line in output.splitlines() if line.strip("= ")]
    telling = [line for line in lines if re.search(r"(?i)not support|unable|error|fail", line)]
    return (telling or lines or ["no output"])[0][:200]


def check(tool, timeout):
    """One line about a tool, its output where that matters, and whether it is content."""
    begin = time.perf_counter()
    control = CONTROLS.get(tool)
    if control:
        planted = inspect(tool, [control], timeout)
        if not planted.count:
            return f"{tool}: not run, misses a planted fault: {reason(planted.output)}", "", True
    found = inspect(tool, [], timeout)
    seconds = f"{time.perf_counter() - begin:.0f} s"
    if found.count is None and found.status == 124:
        return f"{tool}: not finished: {found.output}", "", False
    if found.count is None:
        line = f"{tool}: not run: {reason(found.output)}"
        return line, found.output, "parts done" not in found.output and not control
    if found.count:
        return f"{tool}: {found.count} findings ({seconds})", found.output, False
    if found.status:
        return f"{tool}: the program fails ({seconds})", found.output, False
    parts = re.findall(r"(\d+) parts done", found.output)
    return f"{tool}: 0 findings, {parts[-1] if parts else '?'} parts ({seconds})", "", True


def main():
    """Run the tools side by side."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tools", default="memcheck,racecheck,initcheck")
    parser.add_argument("--timeout", type=float, default=150.0, help="seconds per program")
    options = parser.parse_args()
    if not shutil.which("compute-sanitizer"):
        print("sanitizer: not run: no compute-sanitizer")
        return 0
    tools = options.tools.split(",")
    with ThreadPoolExecutor(len(tools)) as pool:
        results = list(pool.map(lambda tool: check(tool, options.timeout), tools))
    for _, output, _ in results:
        if output:
            print(output[:3000])
    for line, _, _ in results:
        print(line)
    return 0 if all(content for _, _, content in results) else 1


if __name__ == "__main__":
    sys.exit(main())
