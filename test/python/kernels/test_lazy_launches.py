"""Launches on GPUs that wait for their code: order of errors, exit, interrupts, forks.

Without a GPU the programs run on the driver of the unit tests, which records launches, and whose
memory is that of the host.
"""

import os
import sys

import pytest

import programs
import warp as wp


@pytest.fixture
def gpu(tmp_path):
    """The environment of programs with a GPU, or with what stands for one."""
    environment = {"WARP_CACHE_PATH": tmp_path / "cache"}
    if not wp.is_cuda_available():
        if not programs.FAKE_CUDA.exists():
            pytest.skip("needs a GPU, or the driver that the unit tests are built with")
        environment["WARP_CUDA_DRIVER"] = programs.FAKE_CUDA
    return environment


BEGIN = """
import numpy as np, os, sys, threading, time
import warp as wp
from warp import _native

def make(number):
    @wp.kernel(module="unique")
    def double(x: wp.array(dtype=float)):
        i = wp.tid()
        y = x[i] + float(wp.static(number))
        for k in range(wp.static(number + 3)):
            y = wp.sin(y) * wp.cos(y + float(k))
        x[i] = y
    return double
"""


def test_launches_return_before_their_code(gpu):
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
kernels = [make(n) for n in range(6)]
for kernel in kernels:
    wp.launch(kernel, 100, [x], device="cuda:0")
waiting = _native.queued_operations()
x.numpy()
print("waited", waiting > 0, _native.queued_operations())
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["waited", "True", "0"]


def test_translations_are_kept_at_exit(gpu):
    """Other threads write them while launches wait; a program that fails leaves them, too."""
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
for n in range(6):
    wp.launch(make(n), 100, [x], device="cuda:0")
raise RuntimeError("the end")
"""
    )
    status, _, err = programs.run(program, **gpu)
    assert status == 1 and "the end" in err
    assert len(list(gpu["WARP_CACHE_PATH"].glob("*.kernel"))) == 6


@pytest.mark.parametrize("how", ["wp.config.lazy_compile = False", "wp.config.mode = 'debug'"])
def test_settings_keep_launches_in_place(gpu, how):
    program = programs.write_program(
        BEGIN
        + how
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
wp.launch(make(1), 100, [x], device="cuda:0")
print(_native.queued_operations())
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["0"]


def test_shared_memory_keeps_launches_in_place(gpu):
    """Another library that reads the memory knows nothing of what waits."""
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
wp.launch(make(1), 100, [x], device="cuda:0")
x.__cuda_array_interface__
print(_native.queued_operations())
wp.launch(make(2), 100, [x], device="cuda:0")
print(_native.queued_operations())
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["0", "0"]


def test_errors_of_the_program_stay_with_the_launch(gpu):
    program = programs.write_program(
        BEGIN
        + """
@wp.kernel
def wrong(x: wp.array(dtype=float)):
    x[wp.tid()] = undefined_name

x = wp.zeros(100, dtype=float, device="cuda:0")
wp.launch(make(1), 100, [x], device="cuda:0")
for arguments in ([wrong, 100, [x]], [make(2), 100, [1.0]], [make(2), -1, [x]]):
    try:
        wp.launch(*arguments, device="cuda:0")
        print("nothing")
    except Exception as error:
        print(type(error).__name__)
wp.synchronize()
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["WarpCodegenKeyError", "WarpLaunchTypeError", "WarpLaunchValueError"]


def test_exit_during_compilation(gpu):
    """The process ends soon, and with the status of the program."""
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
for n in range(40):
    wp.launch(make(n), 100, [x], device="cuda:0")
raise SystemExit(7)
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 7, err
    assert "Traceback" not in err and "terminate" not in err


@pytest.mark.parametrize(
    "interrupt",
    [
        "threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()",
        "_native.set_progress(lambda *counts: counts[0] is None or signal.raise_signal(2))",
    ],
    ids=["waiting", "in the progress bar"],
)
def test_ctrl_c_while_waiting(tmp_path, interrupt):
    """The wait ends with KeyboardInterrupt; what waits is done by the next one."""
    if not programs.FAKE_CUDA.exists():
        pytest.skip("needs the driver that the unit tests are built with")
    program = programs.write_program(
        BEGIN
        + """
import ctypes, signal
gate = ctypes.CDLL(os.environ["WARP_CUDA_DRIVER"]).fakeCudaSetGate
x = wp.zeros(100, dtype=float, device="cuda:0")
gate(ctypes.c_bool(False))
wp.launch(make(1), 100, [x], device="cuda:0")
try:
    {interrupt}
    wp.synchronize()
except KeyboardInterrupt:
    print("interrupted", _native.queued_operations())
finally:
    gate(ctypes.c_bool(True))
x.numpy()
print(_native.queued_operations())
""",
        interrupt=interrupt,
    )
    environment = {"WARP_CACHE_PATH": tmp_path, "WARP_CUDA_DRIVER": programs.FAKE_CUDA}
    status, out, err = programs.run(program, **environment)
    assert status == 0, err
    assert out.split() == ["interrupted", "1", "0"]


@pytest.mark.skipif(sys.platform != "linux", reason="needs fork")
def test_fork_while_launches_wait(gpu):
    """A child drops what waits; the parent goes on."""
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
for n in range(10):
    wp.launch(make(n), 100, [x], device="cuda:0")
pid = os.fork()
if pid == 0:
    y = wp.zeros(10, dtype=float, device="cpu")
    wp.launch(make(3), 10, [y], device="cpu")
    y.numpy()
    os._exit(5 if _native.queued_operations() == 0 else 6)
print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
x.numpy()
print(_native.queued_operations())
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["5", "0"]


def test_threads_of_python_run_meanwhile(gpu):
    """A thread that waits for code does not hold up the others."""
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
count = 0
ended = False
def work():
    global count
    while not ended:
        count += 1
        time.sleep(0.001)
for n in range(20):
    wp.launch(make(n), 100, [x], device="cuda:0")
thread = threading.Thread(target=work)
thread.start()
begin = time.perf_counter()
x.numpy()
waited = time.perf_counter() - begin
ended = True
thread.join()
print(waited < 0.1 or count > waited * 50)
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["True"]


def test_compile_ahead(gpu):
    """`wp.compile` leaves nothing for the launch; unknown things are refused."""
    program = programs.write_program(
        BEGIN
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
kernels = [make(n) for n in range(4)]
wp.compile(kernels, "cuda:0")
for kernel in kernels:
    wp.launch(kernel, 100, [x], device="cuda:0")
print(_native.queued_operations())
try:
    wp.compile([kernels[0], print])
except TypeError as error:
    print("builtin_function_or_method" in str(error))
"""
    )
    status, out, err = programs.run(program, **gpu)
    assert status == 0, err
    assert out.split() == ["0", "True"]


def test_compile_on_the_cpu():
    """Kernels are compiled side by side, with the results of compiling one."""

    def make(number):
        @wp.kernel(module="unique")
        def add(x: wp.array(dtype=float)):
            x[wp.tid()] += float(wp.static(number))

        return add

    kernels = [make(number) for number in range(5)]
    wp.compile(kernels, "cpu")
    wp.compile(kernels[0], "cpu")
    wp.compile([], "cpu")
    x = wp.zeros(10, dtype=float, device="cpu")
    for kernel in kernels:
        wp.launch(kernel, 10, [x], device="cpu")
    assert (x.numpy() == 10.0).all()


def test_a_bar_after_two_seconds(monkeypatch, capsys):
    """Nothing is shown of short waits, and the line is gone in the end."""
    from warp._src.kernels import progress

    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    monkeypatch.setattr(wp.config, "progress", True)
    now = [100.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    progress.show(0, 8)
    now[0] += 1.9
    progress.show(1, 8)
    assert capsys.readouterr().err == ""
    now[0] += 0.2
    progress.show(4, 8)
    shown = capsys.readouterr().err
    assert "4 of 8 kernels" in shown and shown.count("#") == 15
    progress.show(None, None)
    assert capsys.readouterr().err.strip() == ""
    monkeypatch.setattr(wp.config, "progress", False)
    progress.show(0, 8)
    now[0] += 5
    progress.show(1, 8)
    progress.show(None, None)
    assert capsys.readouterr().err == ""


def test_environment(gpu):
    """Settings of the environment reach the runtime."""
    program = programs.write_program(
        BEGIN
        + "print(wp.config.lazy_compile)"
        + """
x = wp.zeros(100, dtype=float, device="cuda:0")
wp.launch(make(1), 100, [x], device="cuda:0")
print(_native.queued_operations())
"""
    )
    for value, shown in (("0", "False"), ("1", "True")):
        status, out, err = programs.run(program, WARP_LAZY_COMPILE=value, **gpu)
        assert status == 0, err
        assert out.split()[0] == shown and (value == "1" or out.split()[1] == "0")
    assert os.environ.get("WARP_LAZY_COMPILE") is None
