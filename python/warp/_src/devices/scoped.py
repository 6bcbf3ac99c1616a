"""Context managers: timer, device, stream."""

from __future__ import annotations

import time

from warp._src.devices import devices


class ScopedTimer:
    """Measures a block and prints one line, `name took 1.23 ms`.

    Args:
        name: what is measured.
        active: False makes it do nothing.
        print: False measures without printing.
        detailed: profile the block with cProfile.
        dict: gets the time appended to the list under `name`.
        synchronize: wait for all devices before each reading of the clock.
        report_func: called instead of printing, with the timer and the indentation.

    Attributes:
        elapsed: milliseconds, once the block is left.
    """

    indent = -1
    enabled = True

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
        self.dict = dict
        self.synchronize = synchronize
        self.report_func = report_func
        self.elapsed = 0.0
        self.timing_results = []
        if dict is not None:
            dict.setdefault(name, [])

    def __enter__(self):
        if self.active:
            if self.synchronize:
                devices.synchronize()
            if self.detailed:
                import cProfile

                self._profile = cProfile.Profile()
                self._profile.enable()
            ScopedTimer.indent += 1
            self.start = time.perf_counter_ns()
        return self

    def __exit__(self, *exception):
        if not self.active:
            return
        if self.synchronize:
            devices.synchronize()
        self.elapsed = (time.perf_counter_ns() - self.start) / 1e6
        if self.detailed:
            self._profile.disable()
        if self.dict is not None:
            self.dict[self.name].append(self.elapsed)
        indent = "    " * ScopedTimer.indent
        ScopedTimer.indent -= 1
        if self.report_func is not None:
            self.report_func(self, indent)
        elif self.print:
            if self.detailed:
                self._profile.print_stats(sort="tottime")
            print(f"{indent}{self.name} took {self.elapsed:.2f} ms")


class ScopedDevice:
    """Makes a device the default for a block."""

    def __init__(self, device):
        self.device = devices.get_device(device)

    def __enter__(self):
        self._saved = devices.get_device()
        devices.set_device(self.device)
        return self.device

    def __exit__(self, *exception):
        devices.set_device(self._saved)


class ScopedStream:
    """Makes a stream the current one of its device for a block; None changes nothing."""

    def __init__(self, stream, sync_enter=True, sync_exit=False):
        self.stream = stream
        self.sync_enter = sync_enter
        self.sync_exit = sync_exit

    def __enter__(self):
        if self.stream is not None:
            self._device = self.stream.device
            self._saved_device = devices.get_device()
            self._saved = self._device.stream
            devices.set_stream(self.stream, self._device, self.sync_enter)
            devices.set_device(self._device)
        return self.stream

    def __exit__(self, *exception):
        if self.stream is not None:
            devices.set_stream(self._saved, self._device, self.sync_exit)
            devices.set_device(self._saved_device)
