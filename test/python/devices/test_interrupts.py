"""An interrupt at any step of the package's Python code leaves nothing behind: no tape records, no
capture is open, devices, loggers and timers are those of before."""

import _thread
import ctypes
import functools
import gc
import importlib
import random
import signal
import sys
import threading
import time
import types
import weakref

import numpy as np
import pytest
from support.interrupted import InterruptError, interrupted_everywhere
from support.random_runs import seeds

import warp as wp
from warp import _native
from warp._src.arrays.observers import Observers
from warp._src.devices import allocators, call_sites, devices, graphs
from warp._src.logger import LoggerBasic, get_logger

CPU = "cpu"


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def count_down(left: wp.array(dtype=int)):
    left[0] = left[0] - 1


x = wp.array([1.0, 2.0, 3.0], dtype=float, device=CPU, requires_grad=True)
y = wp.zeros(3, dtype=float, device=CPU, requires_grad=True)
ones = wp.ones(3, dtype=float, device=CPU)
left = wp.zeros(1, dtype=int, device=CPU)


def tape():
    with wp.Tape() as recorded:
        wp.launch(square, 3, [x, y], device=CPU)
    recorded.backward(grads={y: ones})


def capture():
    with wp.ScopedCapture(device=CPU) as captured:
        wp.launch(square, 3, [x, y], device=CPU)
        y.fill_(2.0)
    wp.capture_launch(captured.graph)


def loop():
    with wp.ScopedCapture(device=CPU) as captured:
        left.fill_(2)
        wp.capture_while(left, lambda: wp.launch(count_down, 1, [left], device=CPU))
        wp.capture_if(left, lambda: y.fill_(1.0), lambda: y.fill_(2.0))
    wp.capture_launch(captured.graph)


def pair():
    wp.capture_begin(device=CPU)
    wp.capture_while(left, lambda: wp.launch(count_down, 1, [left], device=CPU))
    wp.capture_end(device=CPU)


def scopes():
    with wp.ScopedDevice(CPU), wp.ScopedStream(None), wp.ScopedMemoryTracker("a", print=False):
        wp.zeros(2, dtype=float, device=CPU)
    with wp.ScopedTimer("a", print=False, detailed=True, dict={}, cuda_filter=wp.TIMING_ALL):
        wp.launch(square, 3, [x, y], device=CPU)
    with wp.ScopedLogger(LoggerBasic()), wp.ScopedLogLevel(wp.LOG_ERROR):
        pass
    with devices.OwnDefault(devices.get_device(CPU)):
        pass


def tangents():
    wp.autograd.jvp(lambda a: wp.map(lambda v: v * v, a), [x], [ones])


def timing():
    wp.timing_begin()
    wp.timing_end()


def state():
    """State that an interrupt must not change."""
    return {
        "observers": (Observers.tape, Observers.executor, Observers.timer, Observers.active),
        "told": Observers._told == Observers.active,
        "captures": (dict(graphs._captures), _native.is_capturing(-1)),
        "device": wp.get_device(),
        "own": dict(devices.OwnDefault.blocks),
        "names": list(getattr(call_sites.scopes, "names", [])),
        "tracker": "tracker" in allocators.special,
        "indent": wp.ScopedTimer.indent,
        "logger": (get_logger(), wp.config.log_level),
        "garbage": gc.isenabled(),
    }


@pytest.mark.parametrize("work", [tape, capture, loop, pair, scopes, timing])
def test_state_is_that_of_before(work):
    gc.collect()
    work()
    before = state()

    def check(step):
        # Every block that has begun can be ended.
        if work is pair and graphs._captures:
            wp.capture_end(device=CPU)
        if work is timing:
            wp.timing_end()
        gc.collect(0)
        assert state() == before, f"step {step}"

    assert interrupted_everywhere(work, check) > 10


def again(work, begin):
    """After `begin()`, until something interrupts it."""
    try:
        begin()
        while True:
            work()
    except InterruptError:
        # One in a finalizer may come on top.
        gc.collect(0)


@pytest.mark.parametrize("seed", seeds(1))
@pytest.mark.parametrize("work", [tape, capture, loop, pair])
def test_signals_at_random_moments(work, seed):
    """Handlers that raise, as that of Ctrl-C does, after random times."""

    def interrupt(number, frame):
        raise InterruptError

    work()
    gc.collect()
    before, choose = state(), random.Random(seed)
    handler = signal.signal(signal.SIGALRM, interrupt)
    try:
        for count in range(40):
            after = (signal.ITIMER_REAL, 1e-4 + choose.random() * 4e-3)
            again(work, functools.partial(signal.setitimer, *after))
            if work is pair and graphs._captures:
                wp.capture_end(device=CPU)
            gc.collect(0)
            assert state() == before, f"signal {count}"
    finally:
        signal.signal(signal.SIGALRM, handler)


@pytest.mark.parametrize("seed", seeds(1))
@pytest.mark.parametrize("work", [tape, capture, loop])
def test_exceptions_from_another_thread(work, seed):
    """Interrupts of `PyThreadState_SetAsyncExc`, at random moments."""
    work()
    gc.collect()
    before, choose = state(), random.Random(seed)
    raised = ctypes.py_object(InterruptError)
    thread = ctypes.c_ulong(threading.get_ident())

    def interrupt(delay, done):
        time.sleep(delay)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, raised)
        done.release()

    for count in range(40):
        done = threading.Lock()
        done.acquire()
        arguments = (interrupt, (1e-4 + choose.random() * 4e-3, done))
        again(work, functools.partial(_thread.start_new_thread, *arguments))
        done.acquire()
        gc.collect(0)
        assert state() == before, f"exception {count}"


@pytest.mark.parametrize("work", [tape, capture, loop])
def test_what_follows_is_right(work):
    def check(step):
        gradient = np.zeros(3)
        x.grad.zero_()
        left.fill_(0)
        work()
        assert (y.numpy() == (x.numpy() ** 2 if work is tape else 2.0)).all(), f"step {step}"
        gradient = 2 * x.numpy() if work is tape else 0.0 * x.numpy()
        assert (x.grad.numpy() == gradient).all(), f"step {step}"

    assert interrupted_everywhere(work, check, most=60) > 10


def test_a_kernel_is_translated_after_all():
    """An interrupt of the first launch, also while the kernel is translated, spoils no other."""
    made = []

    def first_launch():
        @wp.kernel(module="unique")
        def cube(x: wp.array(dtype=float), y: wp.array(dtype=float), s: float):
            i = wp.tid()
            for k in range(2):
                y[i] = x[i] * x[i] * (x[i] + float(k)) * s

        cube.unique_key = None
        made.append(cube)
        wp.launch(cube, 3, [x, y, 2.0], device=CPU)

    def check(step):
        if made:
            wp.launch(made[-1], 3, [x, y, 2.0], device=CPU)
        else:
            first_launch()
        numbers = x.numpy()
        assert (y.numpy() == 2.0 * numbers**2 * (numbers + 1.0)).all(), f"step {step}"
        made.clear()

    assert interrupted_everywhere(first_launch, check, most=25) > 10


def test_an_interrupt_in_a_finalizer_is_not_lost():
    """It is raised behind what has freed the object, and the finalizer ends all the same."""

    class Owner:
        pass

    calls = []

    def forget():
        calls.append(None)
        if len(calls) == 1:
            raise InterruptError

    owner = Owner()
    known = weakref.ref(owner, _native.Finalizer(forget))
    with pytest.raises(InterruptError):
        del owner
        for _ in range(1000):
            pass
    assert len(calls) == 2 and known() is None


def test_memory_is_given_back_once_if_an_interrupt_comes():
    freed = []

    def deleter(pointer, size):
        freed.append((pointer, size))
        raise KeyboardInterrupt

    memory = np.arange(4, dtype=np.float32)
    borrowed = wp.array(ptr=memory.ctypes.data, shape=4, dtype=float, device=CPU, deleter=deleter)
    with pytest.raises(KeyboardInterrupt):
        del borrowed
        for _ in range(1000):
            pass
    assert freed == [(memory.ctypes.data, 16)]


def test_errors_of_blocks_are_those_that_are_raised():
    """Leaving a block hides no error, and a block that was refused leaves what is there."""
    with wp.Tape() as outer:
        with pytest.raises(RuntimeError, match="recording already"), outer:
            pass
        assert Observers.tape is outer
    with wp.ScopedCapture(device=CPU) as captured:
        with pytest.raises(RuntimeError, match="being captured"), wp.ScopedCapture(device=CPU):
            pass
        with pytest.raises(ValueError, match="mine"):
            wp.capture_while(left, lambda: (_ for _ in ()).throw(ValueError("mine")))
        y.fill_(3.0)
    wp.capture_launch(captured.graph)
    assert (y.numpy() == 3.0).all()


def test_no_class_has_a_finalizer_of_python():
    """Python prints and loses an interrupt in `__del__`; native finalizers leave it to the program.

    `wp.fabricarray` and annotations of arrays have one that does nothing, as other packages ask.
    """
    importlib.import_module("warp._src.arrays.fabric")
    importlib.import_module("warp.sparse")
    found = {
        one
        for name, module in list(sys.modules.items())
        if name.split(".")[0] == "warp"
        for one in vars(module).values()
        if isinstance(one, type) and isinstance(vars(one).get("__del__"), types.FunctionType)
    }
    assert not found
    assert wp.array.__new__(wp.array).__del__() is None
