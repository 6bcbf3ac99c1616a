"""Loaded code for profilers and debuggers: the map of perf, and GDB's interface."""

import re
import shutil
import subprocess
import sys

import pytest

import programs
import warp as wp

PROGRAM = """
import os
import warp as wp

@wp.kernel
def threefold(x: wp.array[float]):
    i = wp.tid()
    x[i] = 3.0 * x[i]

{first}
x = wp.ones(100000, device="cpu")
wp.launch(threefold, x.shape, [x], device="cpu")
assert x.numpy()[5] == 3.0
path = f"/tmp/perf-{{os.getpid()}}.map"
print(open(path).read() if os.path.exists(path) else "none")
if os.path.exists(path):
    os.remove(path)
"""


def run(first):
    status, out, err = programs.run(programs.write_program(PROGRAM.format(first=first)))
    assert status == 0, err
    return out


def test_without_the_setting_there_is_no_map():
    assert run("") == "none\n"


def test_perf_has_addresses_sizes_and_names():
    """Each line is two hexadecimal numbers and a name; functions do not overlap."""
    out = run('wp.config.profile = "perf"')
    rows = [
        re.fullmatch(r"([0-9a-f]+) ([0-9a-f]+) (\S+)", line) for line in out.splitlines() if line
    ]
    assert rows and all(rows)
    assert any("threefold" in row[3] for row in rows)
    places = sorted((int(row[1], 16), int(row[2], 16)) for row in rows)
    assert all(size > 0 for _, size in places)
    assert all(a + size <= b for (a, size), (b, _) in zip(places, places[1:]))


def test_it_is_set_before_code_is_loaded():
    first = "y = wp.ones(9, device='cpu'); wp.launch(threefold, 9, [y], device='cpu')\n"
    late = "try:\n    wp.config.profile = 'perf'\nexcept RuntimeError as error:\n    print(error)\n"
    said = "profilers and debuggers are chosen before the first kernel for the CPU is loaded"
    assert run(first + late) == f"{said}, which has happened\nnone\n"


def test_wrong_names_are_refused():
    with pytest.raises(ValueError, match="profile expects one of '', 'perf', 'gdb'"):
        wp.config.profile = "valgrind"


def test_gdb_finds_functions_of_kernels(tmp_path):
    """A breakpoint at the entry of a kernel stops there, though no file holds its code."""
    gdb = shutil.which("gdb")
    if not gdb:
        pytest.skip("needs gdb")
    text = PROGRAM.format(first='wp.config.profile = "gdb"')
    # The interrupt comes when code is loaded; the launch behind it runs the function.
    text += "os.kill(os.getpid(), 2)\nwp.launch(threefold, x.shape, [x], device='cpu')\n"
    program, script = programs.write_program(text), tmp_path / "commands"
    script.write_text(
        "set confirm off\nset pagination off\nhandle SIGINT stop print nopass\n"
        "run\nrbreak threefold\ncontinue\nkill\n"
    )
    command = [gdb, "-q", "-batch", "-x", script, "--args", sys.executable, program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert re.search(r"Breakpoint \d+, .*threefold", done.stdout), done.stdout[-3000:] + done.stderr
