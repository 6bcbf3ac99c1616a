"""Context managers: timer, device, stream."""

from __future__ import annotations

import time

from warp import _native
from warp._src.argument_kinds import DICT
from warp._src.arguments import checked
from warp._src.arrays.observers import Observers
from warp._src.devices import devices


class ScopedTimer(_native.Scope):
    """Measures a block and prints one line, `name took 1.23 ms`.

    Args:
        name: what is measured.
        active: False makes it do nothing.
        print: False measures without printing.
        detailed: profile the block with cProfile.
        dict: gets the time appended to the list under `name`.
        use_nvtx: mark the block as a range for profilers, with the package `nvtx`; the time is
            measured, and printed, all the same.
        color: colour of the range.
        synchronize: wait for all devices before each reading of the clock.
        cuda_filter: which activities on CUDA devices to time, a sum of `wp.TIMING_*`.
        report_func: called with the list of activities and the indentation, by default
            `wp.timing_print`.

    Attributes:
        elapsed: milliseconds, once the block is left.
        timing_results: the activities.
        extra_msg: printed behind the time.

    Raises:
        ModuleNotFoundError: `use_nvtx` is set and the package `nvtx` is not installed.
    """

    indent = -1
    enabled = True
    # How far the block itself is indented, while it is entered, and who timed before.
    _indent = _profile = _range = None
    _replaced: tuple = ()

    @checked(dict=DICT)
    def __init__(
        self,
        name,
        active=True,
        print=True,
        detailed=False,
        dict=None,
        use_nvtx=False,
        color="rapids",
        synchronize=False,
        cuda_filter=0,
        report_func=None,
        skip_tape=False,
    ):
        self.name = name
        self.active = active and self.enabled
        self.print = print
        self.detailed = detailed
        self.use_nvtx, self.color = use_nvtx, color
        self.dict = dict
        self.synchronize = synchronize
        self.report_func = report_func
        self.elapsed = 0.0
        self.cuda_filter = cuda_filter
        self.extra_msg = ""
        self.timing_results = []
        if dict is not None:
            dict.setdefault(name, [])

    def _enter(self):
        if self.active:
            nvtx = _nvtx() if self.use_nvtx else None
            if self.synchronize:
                devices.synchronize()
            if self.cuda_filter:
                from warp._src.devices.timing import timing_begin

                self._replaced = (Observers.timer,)
                timing_begin(self.cuda_filter, synchronize=not self.synchronize)
            if self.detailed:
                import cProfile

                self._profile = cProfile.Profile()
                self._profile.enable()
            if nvtx is not None:
                self._range = nvtx, nvtx.start_range(self.name, color=self.color)
            self._indent = ScopedTimer.indent + 1
            ScopedTimer.indent = self._indent
            self.start = time.perf_counter_ns()
        return self

    def _leave(self, kind, *exception):
        if not self.active:
            return
        indent = "    " * ScopedTimer.indent
        ScopedTimer.indent = self._indent - 1
        try:
            self._stop()
        except RuntimeError:
            # An error of the block says more than a device that no longer answers.
            if kind is None:
                raise
            return
        if self.print:
            self._report(indent)

    def _restore(self):
        if self._indent is not None:
            ScopedTimer.indent = self._indent - 1
        self._end_range()
        if self._profile is not None:
            self._profile.disable()
        if self._replaced:
            (Observers.timer,) = self._replaced
            Observers.update()
        self._indent, self._replaced = None, ()

    def _end_range(self):
        if self._range is not None:
            (nvtx, number), self._range = self._range, None
            nvtx.end_range(number)

    def _stop(self):
        """Reads the clock and ends what else was measured."""
        try:
            if self.synchronize:
                devices.synchronize()
        finally:
            self.elapsed = (time.perf_counter_ns() - self.start) / 1e6
            self._end_range()
        if self.detailed:
            self._profile.disable()
        if self.dict is not None:
            self.dict[self.name].append(self.elapsed)
        if self.cuda_filter:
            from warp._src.devices.timing import timing_end

            self.timing_results = timing_end(synchronize=not self.synchronize)

    def _report(self, indent):
        from warp._src.devices.timing import timing_print
        from warp._src.logger import get_logger

        if self.detailed:
            self._profile.print_stats(sort="tottime")
        if self.timing_results:
            (self.report_func or timing_print)(self.timing_results, indent=indent)
        extra = f" {self.extra_msg}" if self.extra_msg else ""
        get_logger().info(f"{indent}{self.name} took {self.elapsed:.2f} ms{extra}")


def _nvtx():
    try:
        import nvtx
    except ModuleNotFoundError as problem:
        raise ModuleNotFoundError(
            "ScopedTimer: `use_nvtx` needs the package nvtx, install it with `pip install nvtx`",
            name="nvtx",
        ) from problem
    return nvtx


class ScopedDevice(_native.Scope):
    """Makes a device the default for a block."""

    def __init__(self, device):
        self.device = devices.get_device(device)

    _saved = None

    def _enter(self):
        self._saved = devices.get_device()
        devices.set_device(self.device)
        return self.device

    def _restore(self):
        if self._saved is not None:
            devices.set_device(self._saved)
        self._saved = None


class ScopedStream(_native.Scope):
    """Makes a stream the current one of its device for a block; None changes nothing."""

    @checked()
    def __init__(self, stream, sync_enter=True, sync_exit=False):
        self.stream = stream
        self.sync_enter = sync_enter
        self.sync_exit = sync_exit

    _saved = None

    def _enter(self):
        if self.stream is not None:
            self._device = self.stream.device
            self._saved = (self._device.stream, devices.get_device())
            devices.set_stream(self.stream, self._device, self.sync_enter)
            devices.set_device(self._device)
        return self.stream

    def _restore(self):
        if self._saved is not None:
            stream, device = self._saved
            devices.set_stream(stream, self._device, self.sync_exit)
            devices.set_device(device)
        self._saved = None
