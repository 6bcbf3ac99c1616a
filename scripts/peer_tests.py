"""Run NVIDIA Warp's public tests against this package, and say how many pass.

    peer_tests.py SITE [--only NAME ...] [--log FOLDER] [--timeout SECONDS]

SITE is the `site-packages` folder of an environment with `warp-lang==1.19.0`, whose wheel carries
the tests. They are copied, never changed in place. Each file runs in a process of its own, on the
CPU, with the `warp` that the interpreter of this script imports. A private name that a file imports
and the package lacks becomes a class that cannot be made, so that the file's other tests run.

Failing tests are sorted by `test/peer/expected.txt`, one `class | pattern | reason` a line:
  internal   asks for private names, generated C++, or the peer's native library
  better     expects an error or a wrong value where this package gives the right result
  missing    a feature that docs/compatibility.md names as absent
A pattern is one of tests' names, or, behind `error:`, one of the last line of what a test raises.
The first pattern that matches counts. A failing test that no line names is a fault and is printed.
The rate is passed / (passed + faults + missing). A pattern that matched no failing test is named at
the end of a whole run. The exit status is 1 for faults and for such patterns.
"""

from __future__ import annotations

import argparse
import ast
import fnmatch
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
EXPECTED = ROOT / "test" / "peer" / "expected.txt"
KINDS = ("internal", "better", "missing")
# Examples by themselves, windows, and arrays of many GiB.
LEFT_OUT = (
    "fem/test_fem_examples.py",
    "test_examples.py",
    "test_render_opengl.py",
    "test_large.py",
)
# Makes the copy `warp.tests`, also in processes that tests start.
FINDER = """
import importlib.util, sys
class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "warp.tests":
            return importlib.util.spec_from_file_location(
                name, {init!r}, submodule_search_locations=[{folder!r}])
sys.meta_path.insert(0, Finder)
"""
# Goes behind the `__init__.py` of the copy: names that whole files need to be imported.
STAND_INS = """
import importlib
import warp, warp.fem
import warp._src.context
class Absent(type):
    def __getattr__(cls, name):
        raise AttributeError(f"private name '{cls.__name__}.{name}'")
def refuse(self, *args, **kwargs):
    raise AttributeError(f"private name '{type(self).__name__}'")
def optional(module, name):
    try:
        found = importlib.import_module(module)
        return getattr(found, name) if name else found
    except (ImportError, AttributeError):
        return Absent(name or module, (Exception,), {"__init__": refuse})
for name in ("_is_graph_capture_allocation_supported", "_is_graph_capture_allocation_enabled"):
    if not hasattr(warp._src.context, name):
        setattr(warp._src.context, name, lambda device: True)
if getattr(warp.fem.Sample, "_wp_absent_", False):
    warp.fem.Sample = warp.struct(type("Sample", (), {"__annotations__": {"qp_index": int}}))
"""
WORKER = r"""
import importlib, json, os, sys, traceback, unittest
name, output = sys.argv[1:]
found = {"passed": [], "failed": {}, "skipped": [], "running": None}

def save():
    with open(output, "w") as file:
        json.dump(found, file)

class Result(unittest.TestResult):
    def startTest(self, test):
        super().startTest(test)
        found["running"] = test.id()
        save()
    def addSuccess(self, test):
        found["passed"].append(test.id())
    def addFailure(self, test, error):
        found["failed"][test.id()] = "".join(traceback.format_exception(*error))[-4000:]
    addError = addFailure
    def addSubTest(self, test, subtest, error):
        if error:
            self.addFailure(test, error)
    def addUnexpectedSuccess(self, test):
        found["failed"][test.id()] = "passed, but was expected to fail"
    def addSkip(self, test, reason):
        found["skipped"].append(test.id())

try:
    module = importlib.import_module(name)
    unittest.defaultTestLoader.loadTestsFromModule(module).run(Result())
except BaseException:
    found["failed"][name + ".<import>"] = traceback.format_exc()[-4000:]
found["passed"] = [test for test in found["passed"] if test not in found["failed"]]
found["running"] = None
save()
sys.stdout.flush()
os._exit(0)
"""


def with_optional_imports(text: str) -> str:
    """The text of a test whose top-level imports of private modules may fail, line by line."""
    lines = text.splitlines()
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom):
            wanted = [
                (node.module or "", name.name, name.asname or name.name) for name in node.names
            ]
        elif isinstance(node, ast.Import):
            wanted = [(name.name, "", name.asname) for name in node.names]
        else:
            continue
        if not all(module.startswith("warp._src") and known for module, _, known in wanted):
            continue
        made = [f"{known} = optional({module!r}, {name!r})" for module, name, known in wanted]
        made.insert(0, "from warp.tests import optional")
        lines[node.lineno - 1 : node.end_lineno] = ["; ".join(made)] + [""] * (
            node.end_lineno - node.lineno
        )
    return "\n".join(lines) + "\n"


def copied_tests(site: Path, folder: Path) -> list[Path]:
    """Copies the tests of a package into `folder/tests`; their paths below it."""
    tests = folder / "tests"
    shutil.copytree(site / "warp" / "tests", tests, ignore=shutil.ignore_patterns("__pycache__"))
    with open(tests / "__init__.py", "a") as file:
        file.write(STAND_INS)
    (folder / "start").mkdir()
    finder = FINDER.format(init=str(tests / "__init__.py"), folder=str(tests))
    (folder / "start" / "sitecustomize.py").write_text(finder)
    files = []
    for file in sorted(tests.rglob("test_*.py")):
        path = file.relative_to(tests)
        if not any(fnmatch.fnmatch(path.as_posix(), pattern) for pattern in LEFT_OUT):
            file.write_text(with_optional_imports(file.read_text()))
            files.append(path)
    return files


def run_file(path: Path, site: Path, folder: Path, timeout: float) -> dict:
    """The results of the tests of a file: `passed`, `failed` with texts, `skipped`."""
    name = "warp.tests." + path.with_suffix("").as_posix().replace("/", ".")
    output = folder / "result.json"
    output.unlink(missing_ok=True)
    search = [str(folder / "start"), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "WARP_EXAMPLE_ASSETS": str(site / "warp" / "examples" / "assets"),
        "CUDA_VISIBLE_DEVICES": "",
        "PYTHONDONTWRITEBYTECODE": "1",
        "WARP_PEER_MESSAGES": "1",
        "PYTHONPATH": os.pathsep.join(search),
    }
    try:
        with open(folder / "output.txt", "w") as text:
            status = subprocess.run(
                [sys.executable, "-c", WORKER, name, str(output)],
                stdout=text,
                stderr=text,
                timeout=timeout,
                env=environment,
                check=False,
            ).returncode
    except subprocess.TimeoutExpired:
        status = "no end"
    empty = {"passed": [], "failed": {}, "skipped": [], "running": None}
    found = json.loads(output.read_text()) if output.is_file() else empty
    if status != 0:
        found["failed"][found["running"] or name] = f"the process ended with {status}"
    return found


def expectations() -> list[tuple[str, str]]:
    """Class and pattern of each line of `expected.txt`."""
    lines = [line.strip() for line in EXPECTED.read_text().splitlines()]
    found = []
    for line in lines:
        if line and not line.startswith("#"):
            kind, pattern, reason = (part.strip() for part in line.split("|", 2))
            if kind not in KINDS or not reason:
                raise ValueError(f"{EXPECTED}: expects 'class | pattern | reason', got {line!r}")
            found.append((kind, pattern))
    return found


def last_line(text: str) -> str:
    return (text.strip().splitlines() or [""])[-1]


def class_of(test: str, text: str, known: list[tuple[str, str]], used: set[str]) -> str:
    """The class of a test that fails with `text`; `fault` if no line names it."""
    short, error = test.removeprefix("warp.tests."), "error:" + last_line(text)
    for kind, pattern in known:
        if fnmatch.fnmatchcase(error if pattern.startswith("error:") else short, pattern):
            used.add(pattern)
            return kind
    return "fault"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("site", type=Path)
    parser.add_argument("--only", nargs="*", default=[], help="parts of files' names")
    parser.add_argument("--log", type=Path, help="folder for the texts of failures")
    parser.add_argument("--timeout", type=float, default=600, help="seconds for each file")
    options = parser.parse_args()
    known, used = expectations(), set()
    counts = Counter(dict.fromkeys(("passed", "skipped", *KINDS, "fault"), 0))
    with tempfile.TemporaryDirectory() as folder:
        for path in copied_tests(options.site, Path(folder)):
            if options.only and not any(part in path.as_posix() for part in options.only):
                continue
            found = run_file(path, options.site, Path(folder), options.timeout)
            counts["passed"] += len(found["passed"])
            counts["skipped"] += len(found["skipped"])
            failed = found["failed"].items()
            kinds = {test: class_of(test, text, known, used) for test, text in failed}
            counts.update(kinds.values())
            print(f"{path}: {len(found['passed'])} passed, {len(kinds)} failed", flush=True)
            for test in (test for test, kind in kinds.items() if kind == "fault"):
                print(
                    f"  FAULT {test.rpartition('.')[2]}: {last_line(found['failed'][test])[:160]}"
                )
            if options.log:
                options.log.mkdir(parents=True, exist_ok=True)
                texts = [
                    f"{test} [{kind}]\n{found['failed'][test]}" for test, kind in kinds.items()
                ]
                name = path.with_suffix("").as_posix().replace("/", ".")
                (options.log / f"{name}.txt").write_text("\n\n".join(texts))
    print(", ".join(f"{count} {kind}" for kind, count in counts.items()))
    behaviour = counts["passed"] + counts["fault"] + counts["missing"]
    if behaviour:
        print(f"{100 * counts['passed'] / behaviour:.1f} % of {behaviour} behavioural tests pass")
    unused = [] if options.only else [one for _, one in known if one not in used]
    for pattern in unused:
        print(f"no failing test matches {pattern!r}: remove its line")
    return 1 if counts["fault"] or unused else 0


if __name__ == "__main__":
    sys.exit(main())
