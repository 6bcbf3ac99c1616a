"""Run the public tests of an installed peer package against it and against this one.

    peer_tests.py run --python PYTHON --tests PEER/warp/tests --out RESULT.jsonl
                      [--package FOLDER] [--only PART]... [--names FILE]
                      [--timeout SECONDS] [--gpu]
    peer_tests.py compare PEER.jsonl OURS.jsonl [--misses]

`run` copies the test files to a temporary folder, makes them `warp.tests` of
whatever `warp` the interpreter imports (with `--package` on its path), and runs
each file in a process of its own under unittest; a line of RESULT holds the
file, the test, its outcome and the first lines of the reason. A test that ends
the process or exceeds the time is such an outcome, and the file goes on behind
it. A file of `--names` has the tests to run, one a line as RESULT names them.
Private names that a file imports and the package lacks become placeholders that
raise when they are used, so that the file's other tests run.

`compare` counts, of what the peer passes, what this package passes too. Tests
that name internals (code generator, hashes, native functions), themselves or in
the helpers that they call, are in neither number; nor are tests that want
something to be refused which this package has, and those are counted by reason.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

# What the rate leaves out: internals of the peer, its build, other libraries.
LEFT_OUT = (
    "apic allocation_tracker allocator block_dim_dispatch compilation core_library_binary "
    "cpu_block_codegen cpu_block_dim cpu_precompiled_headers cpu_vectorization examples "
    "external_build fast_math kernel_cache module_hashing module_parallel_load module_variants "
    "render_opengl template_launch_bounds version apic_load_from_bytes apic_mesh "
    "apic_utility_algorithms"
)
# Tests that something is refused which is there: by file and start of the name, with the reason.
REFUSALS = (
    (
        "test_atomic",
        tuple(f"test_atomic_{kind}_unsupported_dtypes_" for kind in ("add", "min", "max")),
        "want atomics of 8 and 16 bits to be refused, which this package has",
    ),
    (
        "test_codegen",
        (
            "test_rebind_function_local_errors",
            "test_rebind_function_local_to_value_errors",
            "test_rebind_gradwrapper_local_to_value_errors",
            "test_rebind_gradwrapper_local_through_tuple_errors",
            "test_error_mutating_constant_in_dynamic_loop",
        ),
        "want locals that were functions or constants not to be assigned anew",
    ),
    (
        "test_ref",
        (
            "test_ref_rejects_constant_local_argument",
            "test_ref_backward_enabled_kernel_raises",
            "test_ref_shared_helper_backward_raises",
        ),
        "want references to constants, and derivatives through references, to be refused",
    ),
    (
        "test_composite_component_adjoint",
        ("test_array_composite_slot_multiply_assign_backward_rejected",),
        "want derivatives of `*=` on components to be refused",
    ),
    (
        "test_func_parameter_targets",
        ("test_function_custom_grad_rejected",),
        "want functions of functions to have no custom gradients",
    ),
    (
        "test_module_contamination",
        ("test_native_failure_fails_the_module", "test_validation_failure_fails_the_module"),
        "want kernels beside one that fails to be refused",
    ),
    (
        "test_overwrite",
        ("test_cross_tape_write_after_backward_limitation",),
        "want an overwriting not to be told, which the peer does not see",
    ),
    (
        "test_copy",
        ("test_copy_offset_unsupported",),
        "want copies of parts of indexed arrays to be refused",
    ),
    (
        "test_spatial",
        ("test_transform_constructor_copy_dtype_mismatch",),
        "want constructors not to convert numbers",
    ),
    (
        "test_vec_constructors",
        ("test_anon_constructor_error_numeric_args_mismatch",),
        "want constructors not to convert numbers",
    ),
    (
        "test_graph",
        (
            "test_graph_copy_noncontiguous_cpu_rejected",
            "test_graph_fill_noncontiguous_cpu_rejected",
            "test_graph_fill_indexed_cpu_rejected",
        ),
        "want graphs on the CPU to refuse copies and fills of arrays with gaps",
    ),
    (
        "test_unique_module",
        (
            "test_module_options_error_without_unique",
            "test_module_options_empty_dict_non_unique_raises",
            "test_module_options_error_with_named_module",
        ),
        "want module_options to be refused where the module is not unique",
    ),
    (
        "interop.test_jax",
        (
            "test_ffi_jax_kernel_autodiff_per_call_override_rejected_",
            "test_ffi_jax_kernel_output_dims_autodiff_still_blocked_",
        ),
        "want shapes to be refused where derivatives are enabled",
    ),
    (
        "cuda.test_conditional_captures",
        ("test_error_alloc_",),
        "want captures to be refused whose branches or loops allocate",
    ),
    (
        "tile.test_tile_reduce",
        ("test_tile_atomic_add_unsupported_dtype_",),
        "want atomics of 8 and 16 bits to be refused, which this package has",
    ),
    (
        "tile.test_tile_matmul",
        tuple(
            f"test_tile_matmul_{kind}_rejected_"
            for kind in ("bf16_out", "bf16_a_with_backward", "bf16_b_with_backward")
        ),
        "want products of bf16 tiles to be refused",
    ),
    (
        "tile.test_tile_view",
        (
            "test_tile_advanced_index_non_full_slice_rejected_",
            "test_tile_reshape_strided_view_rejected_",
            "test_tile_row_augassign_rejected_",
            "test_tile_slice_augassign_rejected_",
            "test_tile_slice_scalar_assign_rejected_",
        ),
        "want updates of rows and slices, and views of views, to be refused",
    ),
)
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
CHILD = '''
import importlib, inspect, json, re, sys, types, unittest
INTERNAL = re.compile(
    r"_src[.](?!types)|\\b(wp_|warp_)?context[.]|\\bcodegen[.]|Module(Hasher|Builder|BuildOptions)"
    r"|resolve_options|[.]adj\\b|\\bruntime\\b|\\bmock[.]|hash_module|get_module_hash|[.]execs\\b"
    r"|[.]_[a-z]\\w+|user_overloads|[.]get_overload\\b|[.]references\\b|[.]native_func"
    r"|pack_arg|concrete_array_type|infer_argument_types")
absent = []
class Placeholder:
    def __init__(self, name):
        self.__name__ = name
        absent.append(name)
    def __call__(self, *args, **kwargs):
        raise AttributeError("private name: " + self.__name__)
def missing(name):
    if name.startswith("__"):
        raise AttributeError(name)
    return Placeholder(name)
def load(name):
    for _ in range(40):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if not error.name.startswith(("warp._src", "warp.examples")):
                raise
            made = sys.modules[error.name] = types.ModuleType(error.name)
            made.__getattr__ = missing
            made.__path__ = []
            parent, _, last = error.name.rpartition(".")
            setattr(sys.modules[parent], last, made)
        except ImportError as error:
            pattern = "cannot import name '(_?[a-zA-Z]\\w*)' from '(warp._src[.\\w]*)'"
            found = re.match(pattern, str(error))
            if not found:
                raise
            setattr(sys.modules[found[2]], found[1], Placeholder(found[1]))
def stand_in():
    """Private helpers and records of parts left out that whole files need to be imported."""
    import warp
    context = importlib.import_module("warp._src.context")
    if not hasattr(context, "_is_graph_capture_allocation_supported"):
        context._is_graph_capture_allocation_supported = lambda device: True
    fem = importlib.import_module("warp.fem")
    if getattr(fem.Sample, "_wp_absent_", False):
        fem.Sample = warp.struct(type("Sample", (), {"__annotations__": {"qp_index": int}}))
def helpers_of_internals(module):
    """Functions of a test file that name internals: who calls them, does."""
    found = set()
    for name, value in vars(module).items():
        if inspect.isfunction(value) and value.__module__ == module.__name__:
            if not name.startswith("test"):
                source = inspect.getsource(inspect.unwrap(value))
                if INTERNAL.search(source) or any(one in source for one in absent):
                    found.add(name)
    return found
def is_internal(test):
    try:
        source = inspect.getsource(inspect.unwrap(getattr(test, test._testMethodName)))
        if INTERNAL.search(source) or any(name in source for name in absent):
            return True
        return any(re.search(r"\\b" + name + r"[(]", source) for name in helpers)
    except (OSError, TypeError, AttributeError):
        return False
name, out, done = sys.argv[1], sys.argv[2], set(json.loads(sys.argv[3]))
def write(test, outcome, reason="", internal=False):
    with open(out, "a") as file:
        file.write(json.dumps([test, outcome, reason, internal]) + "\\n")
def first(error):
    if not isinstance(error, BaseException):
        error = error[1]
    lines = [line for line in str(error).splitlines() if line.strip()]
    return (type(error).__name__ + ": " + " | ".join(lines[:4]))[:400]
class Result(unittest.TestResult):
    def startTest(self, test):
        super().startTest(test)
        self.outcome = ("passed", "")
        self.internal = is_internal(test)
        write(test.id(), "started")
    def addError(self, test, error):
        self.outcome = ("error", first(error))
        if not hasattr(test, "_testMethodName"):
            write(test.id(), *self.outcome)
    def addFailure(self, test, error):
        self.outcome = ("failed", first(error))
    def addSkip(self, test, reason):
        self.outcome = ("skipped", reason)
    def addSubTest(self, test, subtest, error):
        if error is not None:
            self.outcome = ("failed", first(error))
    def addUnexpectedSuccess(self, test):
        self.outcome = ("failed", "unexpected success")
    def stopTest(self, test):
        write(test.id(), *self.outcome, self.internal)
def flatten(suite):
    for test in suite:
        if isinstance(test, unittest.TestSuite):
            yield from flatten(test)
        else:
            yield test
try:
    stand_in()
    module = load(name)
    helpers = helpers_of_internals(module)
except BaseException as error:
    write(name, "import", first(error))
    raise SystemExit(0)
tests = flatten(unittest.defaultTestLoader.loadTestsFromModule(module))
wanted = set(open(sys.argv[4]).read().split()) if sys.argv[4] else None
chosen = unittest.TestSuite(
    test for test in tests
    if test.id() not in done and (wanted is None or test.id() in wanted))
chosen.run(Result())
write(name, "finished")
'''


def prepare(tests: Path, folder: Path) -> Path:
    """Copy the tests to `folder` and return the folder that makes them importable."""
    copy = folder / "copy" / "warp" / "tests"
    shutil.copytree(tests, copy, ignore=shutil.ignore_patterns("__pycache__"))
    site = folder / "site"
    site.mkdir()
    finder = FINDER.format(init=str(copy / "__init__.py"), folder=str(copy))
    (site / "sitecustomize.py").write_text(finder)
    return site


def module_names(tests: Path, only: list[str]) -> list[str]:
    """Names of the test modules that take part."""
    files = [*tests.glob("test_*.py"), *tests.glob("*/test_*.py")]
    names = sorted(".".join(file.relative_to(tests).with_suffix("").parts) for file in files)
    if only:
        return [name for name in names if any(part in name for part in only)]
    left_out = {f"test_{word}" for word in LEFT_OUT.split()}
    folders = ("matrix.",)
    return [
        name
        for name in names
        if name not in left_out and ("." not in name or name.startswith(folders))
    ]


def run_module(name: str, options: argparse.Namespace, environment: dict) -> list[list[str]]:
    """Outcomes of one file; a test that ended its process is one of them."""
    outcomes: dict[str, list[str]] = {}
    for _ in range(20):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out"
            out.touch()
            command = [options.python, "-c", CHILD, f"warp.tests.{name}", str(out)]
            command.append(json.dumps(sorted(outcomes)))
            command.append(str(options.names.resolve()) if options.names else "")
            reason = ""
            try:
                status = subprocess.run(
                    command,
                    env=environment,
                    cwd=folder,
                    timeout=options.timeout,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    check=False,
                ).returncode
            except subprocess.TimeoutExpired:
                status, reason = 124, "exceeded the time"
            lines = [json.loads(line) for line in out.read_text().splitlines()]
        for line in lines:
            outcomes[line[0]] = line
        if f"warp.tests.{name}" in outcomes:
            break
        stuck = [test for test in outcomes.values() if test[1] == "started"]
        for test in stuck:
            outcomes[test[0]] = [test[0], "crashed", reason or f"exit status {status}", False]
        if not stuck:
            outcomes[name] = [name, "crashed", reason or f"exit status {status}", False]
            break
    return [test for test in outcomes.values() if test[1] != "finished"]


def run(options: argparse.Namespace) -> None:
    """Run the files and write one line per test."""
    with tempfile.TemporaryDirectory() as folder:
        site = prepare(options.tests, Path(folder))
        path = [str(site)] + ([str(options.package)] if options.package else [])
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join(path),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        if not options.gpu:
            environment["CUDA_VISIBLE_DEVICES"] = ""
        with options.out.open("w") as out:
            for name in module_names(options.tests, options.only):
                outcomes = run_module(name, options, environment)
                for outcome in outcomes:
                    out.write(json.dumps([name, *outcome]) + "\n")
                out.flush()
                counts = Counter(outcome[1] for outcome in outcomes)
                print(name, *(f"{count} {word}" for word, count in counts.items()), flush=True)


def read(path: Path) -> dict[tuple[str, str], list]:
    """Outcome, reason and whether it is about internals, by file and test."""
    lines = map(json.loads, path.read_text().splitlines())
    return {(line[0], line[1]): [*line[2:], False][:3] for line in lines}


def refusal(file: str, test: str) -> str | None:
    """Why a test wants less than this package has, None if it does not."""
    name = test.rpartition(".")[2]
    for of, starts, reason in REFUSALS:
        if file == of and name.startswith(starts):
            return reason
    return None


def compare(options: argparse.Namespace) -> None:
    """Print, per file, what both pass, and what only the peer passes and why."""
    peer, ours = read(options.peer), read(options.ours)
    failed_imports = {key[0]: value[1] for key, value in ours.items() if value[0] == "import"}
    totals, both, misses, internal, refusals = Counter(), Counter(), [], 0, Counter()
    for (file, test), (outcome, _, peer_internal) in peer.items():
        absent = ("absent", failed_imports.get(file, "not collected"), False)
        result = ours.get((file, test), absent)
        if outcome != "passed":
            continue
        if peer_internal or result[2]:
            internal += 1
            continue
        if result[0] != "passed" and (reason := refusal(file, test)):
            refusals[reason] += 1
            continue
        totals[file] += 1
        if result[0] == "passed":
            both[file] += 1
        else:
            misses.append((file, test.rpartition(".")[2], *result[:2]))
    for file, total in totals.items():
        print(f"{file:40} {both[file]:5} of {total:5}")
    rate = 100 * both.total() / max(1, totals.total())
    print(f"{'all':40} {both.total():5} of {totals.total():5}  {rate:.1f} %")
    print(f"{internal} tests of internals left out")
    for reason, count in refusals.items():
        print(f"{count} tests left out that {reason}")
    if options.misses:
        for miss in misses:
            print(*miss, sep="  ")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    runs = commands.add_parser("run")
    runs.add_argument("--python", default=sys.executable)
    runs.add_argument("--tests", type=Path, required=True)
    runs.add_argument("--package", type=Path)
    runs.add_argument("--out", type=Path, required=True)
    runs.add_argument("--only", action="append", default=[])
    runs.add_argument("--names", type=Path, help="file of the tests to run")
    runs.add_argument("--gpu", action="store_true", help="on GPUs, too")
    runs.add_argument("--timeout", type=float, default=600)
    runs.set_defaults(call=run)
    compares = commands.add_parser("compare")
    compares.add_argument("peer", type=Path)
    compares.add_argument("ours", type=Path)
    compares.add_argument("--misses", action="store_true")
    compares.set_defaults(call=compare)
    options = parser.parse_args()
    options.call(options)


if __name__ == "__main__":
    main()
