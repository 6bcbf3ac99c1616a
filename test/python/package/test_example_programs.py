"""`python -m warp.examples`: the list, and what running one says."""

import subprocess
import sys
from pathlib import Path

from warp.examples import __main__ as examples

ROOT = Path(__file__).resolve().parents[3]


def run(*arguments):
    command = [sys.executable, "-m", "warp.examples", *arguments]
    return subprocess.run(command, capture_output=True, text=True)


def test_all_examples_are_listed():
    programs = {
        path.stem
        for path in (ROOT / "examples").rglob("*.py")
        if "__main__" in path.read_text() and path.parent.name not in ("c", "cpp")
    }
    assert len(programs) > 10
    assert set(examples.examples()) == programs
    shown = run().stdout
    assert all(f"{name} " in shown for name in programs)


def test_a_reader_may_stop_early():
    """As `python -m warp.examples | head -1` does."""
    command = [sys.executable, "-m", "warp.examples"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.stderr.read() == b""
    assert process.wait() == 0


def test_an_example_gets_its_options():
    done = run("particles", "--help")
    assert done.returncode == 0, done.stderr
    assert "--cloud" in done.stdout


def test_an_unknown_example_names_all():
    done = run("oceans")
    assert done.returncode == 1
    assert "no example 'oceans', there are: " in done.stderr and "ocean," in done.stderr


def test_a_missing_package_names_the_extra(tmp_path, monkeypatch):
    program = tmp_path / "drawing.py"
    program.write_text("import a_package_that_is_not_there\n")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "argv", list(sys.argv))
    try:
        examples.run(program, [])
    except SystemExit as stop:
        assert 'run `pip install "warp-mlir[examples]"`' in str(stop)
    else:
        raise AssertionError("it has run")
