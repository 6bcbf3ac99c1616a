"""Kernels of programs that are no files: `python -c`, standard input, `exec`."""

import subprocess
import sys

import pytest

PROGRAM = """
import warp as wp
wp.config.quiet = True

@wp.func
def twice(a: float):
    return 2.0 * a

@wp.kernel
def k(x: wp.array(dtype=float)):
    x[wp.tid()] = twice(1.5)

x = wp.zeros(3, dtype=float, device="cpu")
wp.launch(k, 3, [x], device="cpu")
print(x)
"""
MISTAKE = PROGRAM.replace("twice(1.5)", "twise(1.5)")


def run(*arguments, **options):
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, timeout=120, **options
    )


@pytest.mark.parametrize("flags", [["-c"], ["-Bc"], ["-X", "utf8", "-W", "ignore", "-c"]])
def test_programs_of_the_command_line(flags):
    done = run(*flags, PROGRAM, "argument")
    assert done.stdout.strip() == "[3. 3. 3.]", done.stderr


def test_messages_show_lines_of_the_command_line():
    done = run("-c", MISTAKE)
    assert "x[wp.tid()] = twise(1.5)" in done.stderr


def test_programs_of_standard_input(tmp_path):
    (tmp_path / "a.py").write_text(PROGRAM)
    with open(tmp_path / "a.py") as file:
        done = run("-", stdin=file)
    assert done.stdout.strip() == "[3. 3. 3.]", done.stderr


@pytest.mark.parametrize(
    ("arguments", "text", "hint"),
    [
        (["-"], PROGRAM, "put it into a file"),
        (["-c", f"exec({PROGRAM!r})"], None, r"linecache.cache['<string>']"),
    ],
)
def test_other_texts_are_refused_with_a_way_out(arguments, text, hint):
    done = run(*arguments, input=text)
    assert done.returncode == 1 and "source of" in done.stderr and hint in done.stderr


def test_the_way_out_works():
    register = "import linecache; linecache.cache['<string>'] = (1, None, t.splitlines(True), '')"
    done = run("-c", f"t = {PROGRAM!r}; {register}; exec(t)")
    assert done.stdout.strip() == "[3. 3. 3.]", done.stderr
