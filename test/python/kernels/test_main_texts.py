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
        (["-c", "import sys; exec(sys.stdin.read())"], PROGRAM, "wp.kernel(source=...)"),
    ],
)
def test_other_texts_are_refused_with_a_way_out(arguments, text, hint):
    done = run(*arguments, input=text)
    assert done.returncode == 1 and "source of" in done.stderr and hint in done.stderr


@pytest.mark.parametrize(
    "program",
    [
        f"exec({PROGRAM!r})",
        f"t = {PROGRAM!r}; exec(t)",
        f"def run(t):\n    exec(t, {{}})\nrun({PROGRAM!r})",
        f"from __future__ import annotations\nt = {PROGRAM!r}; exec(t)",
    ],
)
def test_strings_for_exec(tmp_path, program):
    (tmp_path / "a.py").write_text(program)
    for arguments in (["-c", program], [str(tmp_path / "a.py")]):
        done = run(*arguments)
        assert done.stdout.strip() == "[3. 3. 3.]", done.stderr


def test_strings_for_exec_are_told_from_the_program_and_from_each_other():
    """All of them are in a file `<string>`, with a kernel of one name on the same line."""
    others = [PROGRAM.replace("twice(1.5)", f"twice({value})") for value in ("2.5", "2.0", "-0.0")]
    done = run("-c", PROGRAM + f"for t in {others!r}:\n    exec(t)\n")
    assert done.stdout.split("\n")[:4] == [
        "[3. 3. 3.]",
        "[5. 5. 5.]",
        "[4. 4. 4.]",
        "[-0. -0. -0.]",
    ]


def test_messages_show_lines_of_strings_for_exec():
    done = run("-c", PROGRAM + f"exec({MISTAKE!r})\n")
    assert "x[wp.tid()] = twise(1.5)" in done.stderr


def test_the_way_out_works():
    register = "import linecache; linecache.cache['<string>'] = (1, None, t.splitlines(True), '')"
    done = run("-c", f"t = {PROGRAM!r}; {register}; exec(t)")
    assert done.stdout.strip() == "[3. 3. 3.]", done.stderr
