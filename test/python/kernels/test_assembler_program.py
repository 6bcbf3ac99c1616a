"""Code of queued kernels by a program beside the driver: search, exit, interrupts.

The driver is that of the unit tests, of CUDA 12.8, and scripts stand for `ptxas`: they write PTX
behind the first bytes of an object, which is what that driver calls machine code.
"""

import os
import time

import pytest

import programs

ASSEMBLE = """{ printf '\\177ELF'; cat "$2"; } > "$4" """

PROGRAM = """
import ctypes, os, signal, time
import warp as wp
from warp import _native

def make(number):
    @wp.kernel(module="unique")
    def add(x: wp.array(dtype=float)):
        x[wp.tid()] += float(wp.static(number))
    return add

driver = ctypes.CDLL(os.environ["WARP_CUDA_DRIVER"])
wp.config.compile_threads = 1
x = wp.zeros(100, dtype=float, device="cuda:0")
kernels = [make(n) for n in range(6)]
before = driver.fakeCudaAssemblies()
driver.fakeCudaSetGate(ctypes.c_bool(False))
for kernel in kernels:
    wp.launch(kernel, 100, [x], device="cuda:0")
driver.fakeCudaSetGate(ctypes.c_bool(True))
"""


# Codes by the driver, and times that the program was asked, before any code for later processes.
SHOW = """
wp.synchronize()
asked = os.environ["ASKED"]
print(
    driver.fakeCudaAssemblies() - before,
    len(open(asked).readlines()) if os.path.exists(asked) else 0,
    flush=True,
)
os._exit(0)
"""


class Assembler:
    """A script that says of each time that it is asked, and then does something."""

    def __init__(self, folder, work, release="12.8"):
        (folder / "bin").mkdir()
        self.file = folder / "bin" / "ptxas"
        self.log = folder / "asked"
        self.file.write_text(
            f"""#!/bin/sh
if [ "$1" = --version ]; then
  echo "Cuda compilation tools, release {release}, V{release}.93"; exit 0
fi
echo $$ $5 >> {self.log}
{work}
"""
        )
        self.file.chmod(0o755)

    def processes(self):
        """Numbers of the processes that were started so far."""
        return [int(line.split()[0]) for line in self.lines()]

    def lines(self):
        """A number for each process, and how it was asked to hurry."""
        return self.log.read_text().splitlines() if self.log.exists() else []


def environment_of(tmp_path, **more):
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    return {
        "WARP_CACHE_PATH": tmp_path / "cache",
        "WARP_CUDA_DRIVER": programs.FAKE_CUDA,
        "ASKED": tmp_path / "asked",
        **more,
    }


def is_there(process):
    """True for a process that has not ended, or that nobody has waited for."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("how", ["setting", "path", "home", "none"])
def test_kernels_that_wait_are_assembled_by_a_program(tmp_path, how):
    """The last three find few others, so the driver makes them, and maybe the first."""
    assembler = Assembler(tmp_path, ASSEMBLE)
    environment = environment_of(tmp_path)
    path = f"{assembler.file.parent}:{os.environ['PATH']}"
    environment |= {
        "setting": {"WARP_PTXAS": assembler.file},
        "path": {"WARP_PTXAS": "auto", "PATH": path},
        "home": {"WARP_PTXAS": "auto", "CUDA_HOME": tmp_path},
        "none": {"WARP_PTXAS": "none", "PATH": path},
    }[how]
    program = programs.write_program(PROGRAM + SHOW)
    status, out, err = programs.run(program, **environment)
    assert status == 0, err
    made, asked = map(int, out.split())
    assert made + asked == 6
    assert asked == 0 if how == "none" else asked >= 2


def test_long_kernels_are_assembled_with_less_effort_first(tmp_path):
    """Code of all effort follows the second launch; a later process asks for none."""
    assembler = Assembler(tmp_path, ASSEMBLE, release="13.0")
    environment = environment_of(tmp_path, WARP_PTXAS=assembler.file, FAKE_CUDA_VERSION=13000)
    steps = "\n".join(f"    y = y * y + {step}.5" for step in range(3500))
    program = programs.write_program(
        """
import warp as wp
from warp import _native

@wp.kernel
def long(x: wp.array(dtype=float)):
    i = wp.tid()
    y = x[i]
{steps}
    x[i] = y

x = wp.zeros(100, dtype=float, device="cuda:0")
for _ in range(3):
    wp.launch(long, 100, [x], device="cuda:0")
    wp.synchronize()
_native.wait_for_background()
print(len(long.prepare().ir("ptx", 90)) >= 100_000)
""",
        steps=steps,
    )
    for _ in range(2):
        status, out, err = programs.run(program, **environment)
        assert status == 0, err
        assert out.split() == ["True"]
        first, second = (line.split()[1:] for line in assembler.lines())
        assert first == ["--Ofast-compile=min"]
        assert second == []


def test_code_that_is_needed_at_once_comes_before_what_waits(tmp_path):
    """The driver has others to assemble: a question for registers is answered beside it."""
    assembler = Assembler(tmp_path, ASSEMBLE)
    environment = environment_of(tmp_path, WARP_PTXAS=assembler.file)
    program = programs.write_program(
        PROGRAM.replace("driver.fakeCudaSetGate(ctypes.c_bool(True))", "")
        + """
import threading
asked = os.environ["ASKED"]
def count():
    return len(open(asked).readlines()) if os.path.exists(asked) else 0

def open_gate():
    for _ in range(1000):
        if count() - before == 1:
            break
        time.sleep(0.01)
    print(count() - before)
    driver.fakeCudaSetGate(ctypes.c_bool(True))

time.sleep(0.5)
before = count()
threading.Thread(target=open_gate).start()
print(len(wp.get_cuda_kernel_properties(make(7), "cuda:0")) > 2)
"""
    )
    status, out, err = programs.run(program, **environment)
    assert status == 0, err
    assert out.split() == ["1", "True"]


def test_exit_ends_the_program(tmp_path):
    """Code for later processes is given up, and no program is left behind."""
    assembler = Assembler(tmp_path, "exec sleep 60")
    environment = environment_of(tmp_path, WARP_PTXAS=assembler.file)
    program = programs.write_program(
        PROGRAM.replace("range(6)", "range(1)")
        + """
wp.synchronize()
while not os.path.exists(os.environ["ASKED"]):
    time.sleep(0.01)
raise SystemExit(7)
"""
    )
    begin = time.monotonic()
    status, _, err = programs.run(program, **environment)
    assert status == 7, err
    assert "Traceback" not in err and "terminate" not in err
    assert time.monotonic() - begin < 50
    assert assembler.processes()
    assert not any(is_there(process) for process in assembler.processes())


def test_ctrl_c_is_not_for_the_program(tmp_path):
    """A terminal tells all programs; the code comes nevertheless, and not from the driver."""
    assembler = Assembler(tmp_path, "sleep 0.5\n" + ASSEMBLE)
    environment = environment_of(tmp_path, WARP_PTXAS=assembler.file)
    program = programs.write_program(
        """
import os
os.setpgrp()
"""
        + PROGRAM
        + """
signal.signal(signal.SIGINT, signal.default_int_handler)
while not os.path.exists(os.environ["ASKED"]):
    time.sleep(0.01)
try:
    os.killpg(os.getpgrp(), signal.SIGINT)
    time.sleep(10)
except KeyboardInterrupt:
    print("interrupted")
"""
        + SHOW
    )
    status, out, err = programs.run(program, **environment)
    assert status == 0, err
    word, made, asked = out.split()
    assert word == "interrupted"
    assert int(made) + int(asked) == 6 and int(asked) >= 2


def test_programs_that_wait_for_all_children(tmp_path):
    """The driver does what nobody knows the end of."""
    assembler = Assembler(tmp_path, ASSEMBLE)
    environment = environment_of(tmp_path, WARP_PTXAS=assembler.file)
    program = programs.write_program(
        "import signal\nsignal.signal(signal.SIGCHLD, signal.SIG_IGN)\n"
        + PROGRAM
        + "wp.synchronize()\nprint(_native.queued_operations())\n"
    )
    status, out, err = programs.run(program, **environment)
    assert status == 0, err
    assert out.split() == ["0"]
