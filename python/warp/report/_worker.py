"""Points run in a process of their own, so that one that never ends can be ended.

The parent sends cases through a pipe and waits for a record, no longer than a limit; a worker that
passes it is killed and the next point starts a fresh one. A scene that takes the process down is
a failed point, not a failed report.
"""

import contextlib
import multiprocessing
import runpy
import signal
import sys

from warp.report._measure import measure, unpack_case, verdict
from warp.report._scene import registered


def load(file):
    """Register the scenes of a file: of the package's by its module, of a user's by its path."""
    if any(scene.file == file for scene in registered().values()):
        return
    runpy.run_path(file, run_name="__warp_report__")


def _work(pipe, file, name, repeats, budget):
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        load(file)
        scene = registered()[name]
    except Exception as error:
        pipe.send(f"cannot load scene '{name}' of '{file}': {type(error).__name__}: {error}")
        return
    pipe.send("ready")
    while True:
        data = pipe.recv()
        if data is None:
            return
        pipe.send(measure(scene, unpack_case(data), repeats, budget))


class Worker:
    """Measures the points of one scene, each within `limit` seconds."""

    def __init__(self, scene, limit, repeats, budget):
        self.scene, self.limit = scene, limit
        self.options = (repeats, budget)
        self.process = self.pipe = None

    def measure(self, case):
        """The record of a case; status 'timeout' or 'failed' where the worker gave none."""
        if self.limit is None:
            return measure(self.scene, case, *self.options)
        try:
            self._start()
            self.pipe.send(
                {
                    "device": case.device,
                    "dtype": case.dtype,
                    "parameters": case.parameters,
                    "quick": case.quick,
                }
            )
            if self.pipe.poll(self.limit):
                return self.pipe.recv()
            self.stop()
            return self._lost(case, "timeout", f"did not end within {self.limit:g} s")
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self.process.join(5)
            code = self.process.exitcode
            self.stop()
            return self._lost(case, "failed", f"took its process down (exit status {code})")
        except RuntimeError as error:
            self.stop()
            return self._lost(case, "failed", str(error))

    def _start(self):
        if self.process is not None:
            return
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(
            target=_work,
            args=(other, self.scene.file, self.scene.name, *self.options),
            daemon=True,
        )
        # A worker imports what it needs by the scene's file; the parent's own
        # main module is none of its business and may start a report itself.
        main = sys.modules["__main__"]
        hidden = {name: main.__dict__.pop(name, None) for name in ("__file__", "__spec__")}
        main.__spec__ = None
        try:
            self.process.start()
        finally:
            main.__dict__.update({k: v for k, v in hidden.items() if v is not None})
        other.close()
        answer = self.pipe.recv()
        if answer != "ready":
            raise RuntimeError(answer)

    def _lost(self, case, status, reason):
        record = {
            "scene": self.scene.name,
            "device": case.device,
            "dtype": case.dtype,
            "parameters": dict(case.parameters),
            "status": status,
            "reason": reason,
            "expected": self.scene.expect(case),
            "errors": {},
            "unjudged": {},
            "bars": {},
            "series": {},
        }
        return record | {"verdict": verdict(self.scene, case, record)}

    def stop(self):
        """End the process, at once if it does not answer."""
        if self.process is None:
            return
        process, pipe, self.process, self.pipe = self.process, self.pipe, None, None
        with contextlib.suppress(OSError, ValueError):
            pipe.send(None)
        process.join(0.5 if process.exitcode is None else 0.0)
        if process.is_alive():
            process.kill()
            process.join(5)
        pipe.close()
