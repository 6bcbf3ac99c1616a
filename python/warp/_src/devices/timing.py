"""Times of single launches, copies and fills on CUDA devices."""

from __future__ import annotations

import ctypes

from warp import _native
from warp._src.argument_kinds import INTEGER, TEXT, TIMINGS
from warp._src.arguments import checked
from warp._src.arrays.observers import Observers
from warp._src.devices import devices
from warp._src.devices.streams import Event, get_event_elapsed_time

TIMING_KERNEL = 1
TIMING_KERNEL_BUILTIN = 2
TIMING_MEMCPY = 4
TIMING_MEMSET = 8
TIMING_GRAPH = 16
TIMING_ALL = 0xFFFFFFFF


class TimingResult:
    """One activity.

    Attributes:
        device: where it ran.
        name: of the kernel or the operation.
        filter: its kind, one of `wp.TIMING_*`.
        elapsed: milliseconds.
    """

    def __init__(self, device, name, filter, elapsed):
        self.device, self.name, self.filter, self.elapsed = device, name, filter, elapsed


class _Timer:
    """Puts events around what observers are told of."""

    def __init__(self, chosen):
        self.chosen = chosen
        self.found = []

    def measure(self, kind, name, device, run) -> None:
        device = devices.by_index(device) if isinstance(device, int) else device
        if not device.is_cuda or not kind & self.chosen:
            return run()
        events = [Event(device, enable_timing=True) for _ in range(2)]
        stream = device.stream
        stream.record_event(events[0])
        run()
        stream.record_event(events[1])
        self.found.append((device, name, kind, events))
        return None


@checked(cuda_filter=INTEGER)
def timing_begin(cuda_filter: int = TIMING_ALL, synchronize: bool = True) -> None:
    """Begins to time launches, copies and fills on CUDA devices; backward passes are not seen.

    Args:
        cuda_filter: which kinds, a sum of `wp.TIMING_*`.
        synchronize: wait for all devices before.

    Raises:
        KeyboardInterrupt: it was interrupted, then nothing is timed.
    """
    if synchronize:
        devices.synchronize()
    try:
        Observers.timer = _Timer(cuda_filter)
        Observers.update()
    except BaseException:
        Observers.timer = None
        Observers.update()
        raise


@checked()
def timing_end(synchronize: bool = True) -> list[TimingResult]:
    """Ends it, and returns what was found in its order; nothing if nothing was begun.

    Args:
        synchronize: wait for all devices before; without it the caller has to.
    """
    timer, Observers.timer = Observers.timer, None
    Observers.update()
    if synchronize:
        devices.synchronize()
    return [
        TimingResult(device, name, kind, get_event_elapsed_time(*events))
        for device, name, kind, events in (timer.found if timer else ())
    ]


@checked(results=TIMINGS, indent=TEXT)
def timing_print(results: list[TimingResult], indent: str = "") -> None:
    """Prints activities, and their sums by name and by device."""
    if not results:
        print("No activity")
        return
    line = f"{indent}{'-' * 16}+---------+-------------"
    print(f"{indent}CUDA timeline:\n{line}\n{indent}Time            | Device  | Activity\n{line}")
    by_name, by_device = {}, {}
    for result in results:
        device = result.device.alias
        print(f"{indent}{result.elapsed:12.6f} ms | {device:7s} | {result.name}")
        by_name.setdefault(result.name, []).append(result.elapsed)
        by_device.setdefault(device, []).append(result.elapsed)
    for title, groups in (("activity", by_name), ("device", by_device)):
        print(f"\n{indent}CUDA {title} summary:\n{line}")
        print(f"{indent}Total time      | Count   | {title.capitalize()}\n{line}")
        for name, times in groups.items():
            print(f"{indent}{sum(times):12.6f} ms | {len(times):7d} | {name}")


def _profiler(device, entry) -> None:
    device = devices.get_device(device)
    if not device.is_cuda:
        return
    driver = ctypes.CDLL("libcuda.so.1")
    context = ctypes.c_void_p()
    status = driver.cuDevicePrimaryCtxRetain(ctypes.byref(context), device.ordinal)
    status = status or driver.cuCtxPushCurrent_v2(context)
    status = status or getattr(driver, entry)()
    driver.cuCtxPopCurrent_v2(ctypes.byref(context))
    driver.cuDevicePrimaryCtxRelease_v2(device.ordinal)
    if status:
        raise RuntimeError(f"{entry} failed with error {status}")


def cuda_profiler_start(device=None) -> None:
    """Lets a profiler that is attached collect from here.

    Does nothing if the device is the CPU.

    Raises:
        RuntimeError: the driver refuses.
    """
    _profiler(device, "cuProfilerStart")


def cuda_profiler_stop(device=None) -> None:
    """Ends what `cuda_profiler_start` began; raises the same errors."""
    _profiler(device, "cuProfilerStop")


class ScopedCudaProfiler(_native.Scope):
    """Lets a profiler that is attached collect a block."""

    def __init__(self, device=None):
        self.device = devices.get_device(device)

    _started = False

    def _enter(self):
        self._started = True
        try:
            cuda_profiler_start(self.device)
        except Exception:
            self._started = False
            raise
        return self

    def _restore(self):
        if self._started:
            cuda_profiler_stop(self.device)
        self._started = False
