"""Points of a scene, each measured in a process apart."""

import runpy

import warp as wp
from warp.report._measure import measure, unpack_case, verdict
from warp.report._remote import LostWorkError, Remote
from warp.report._scene import registered


def load(file):
    """Register the scenes of a file: of the package's by its module, of a user's by its path."""
    if any(scene.file == file for scene in registered().values()):
        return
    runpy.run_path(file, run_name="__warp_report__")


def _prepare(file, name, repeats, budget):
    wp.config.quiet = True
    try:
        load(file)
        scene = registered()[name]
    except Exception as error:
        text = f"cannot load scene '{name}' of '{file}': {type(error).__name__}: {error}"
        raise RuntimeError(text) from None
    return lambda data: measure(scene, unpack_case(data), repeats, budget)


class Worker:
    """Measures the points of one scene, each within `limit` seconds."""

    def __init__(self, scene, limit, repeats, budget):
        self.scene, self.limit = scene, limit
        self.options = (repeats, budget)
        self.remote = Remote(_prepare, (scene.file, scene.name, *self.options), limit)

    def measure(self, case):
        """The record of a case; status 'timeout' or 'failed' where the worker gave none."""
        if self.limit is None:
            return measure(self.scene, case, *self.options)
        data = {"device": case.device, "dtype": case.dtype}
        data |= {"parameters": case.parameters, "quick": case.quick}
        try:
            return self.remote.ask(data)
        except LostWorkError as lost:
            return self._lost(case, lost.status, str(lost))

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
        self.remote.stop()
