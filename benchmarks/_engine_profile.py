"""One scene of a physics engine by kernel; benchmarks/engines.py runs it in a process of its own.

    _engine_profile.py SCENE WORLDS STEPS DEVICE

Prints `RESULT` and an object: seconds of the first step, microseconds of a step, launches of a
step, the coordinates at the end, and for each kernel its launches in a step, their microseconds,
and the megabytes of the arrays that they get. On a GPU the step is a captured graph and kernels
are timed by the profiler of PyTorch (CUPTI), or, without PyTorch, by events around the launches of
a step that is not captured. On a CPU a launch is timed where it is made, the call included.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections import defaultdict
from pathlib import Path

# The folder of this file has modules whose names others may mean: it comes last.
sys.path[:] = [path for path in sys.path if Path(path or ".").resolve() != Path(__file__).parent]

import numpy as np  # noqa: E402

import warp as wp  # noqa: E402

sys.path.append(str(Path(__file__).parent))
from _engine_newton import newton_scene  # noqa: E402

wp.config.log_level = 30

# Files of the test data that mujoco_warp is installed with.
MUJOCO = {
    "humanoid": "humanoid/humanoid.xml",
    "n_humanoid": "humanoid/n_humanoid.xml",
    "aloha_pot": "aloha_pot/scene.xml",
    "hfield": "hfield/hfield.xml",
    "collision": "collision.xml",
    "tendon": "tendon/wrap.xml",
    "flex": "flex/floppy.xml",
}


# Contacts and constraints of a world where mujoco_warp's own benchmarks name them: the default is
# that of the first state, and a scene that outgrows it prints in every step.
LIMITS = {"n_humanoid": {"nconmax": 100, "njmax": 192}}


def mujoco_scene(name: str, worlds: int):
    """A step, and the coordinates of the first world."""
    import mujoco
    import mujoco_warp as engine

    path = Path(engine.__file__).parent / "test_data" / MUJOCO[name]
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    state = (
        engine.put_model(model),
        engine.put_data(model, data, nworld=worlds, **LIMITS.get(name, {})),
    )
    return lambda: engine.step(*state), lambda: state[1].qpos.numpy()[0]


def plain(name: str) -> str:
    """A kernel's name as both packages have it."""
    name = re.sub(r"_cuda_kernel_(forward|backward)$", "", name)
    name = re.sub(r"_[0-9a-f]{8}$", "", name)
    return name.replace("__locals__", "_")


class Launches:
    """Wraps `wp.launch` and `wp.launch_tiled`, to see the launches of a step.

    Attributes:
        rows: launches, microseconds and bytes of the arrays by kernel.
    """

    def __init__(self, synchronous: bool):
        self.rows = defaultdict(lambda: [0, 0.0, 0])
        self.synchronous = synchronous
        self.events = []
        self.inside = False
        self.originals = {name: getattr(wp, name) for name in ("launch", "launch_tiled")}

    def __enter__(self):
        for name, function in self.originals.items():
            setattr(wp, name, self.wrapped(function))
        return self

    def __exit__(self, *_):
        for name, function in self.originals.items():
            setattr(wp, name, function)
        wp.synchronize()
        for name, begin, end in self.events:
            self.rows[name][1] += 1000.0 * wp.get_event_elapsed_time(begin, end)

    def wrapped(self, function):
        def launch(*args, **kwargs):
            if self.inside:
                return function(*args, **kwargs)
            self.inside = True
            kernel = args[0] if args else kwargs["kernel"]
            row = self.rows[plain(kernel.key.replace("<locals>", "locals").replace(".", "_"))]
            row[0] += 1
            arrays = {}
            for value in (*args[2:], *kwargs.values()):
                for one in value if isinstance(value, (list, tuple)) else ():
                    if isinstance(one, wp.array) and one.ptr:
                        size = one.size * wp.types.type_size_in_bytes(one.dtype)
                        arrays[one.ptr] = max(arrays.get(one.ptr, 0), size)
            row[2] += sum(arrays.values())
            try:
                return self.timed(kernel, row, function, args, kwargs)
            finally:
                self.inside = False

        return launch

    def timed(self, kernel, row, function, args, kwargs):
        if self.synchronous:
            begin = time.perf_counter()
            result = function(*args, **kwargs)
            row[1] += 1e6 * (time.perf_counter() - begin)
            return result
        begin, end = wp.Event(enable_timing=True), wp.Event(enable_timing=True)
        wp.record_event(begin)
        result = function(*args, **kwargs)
        wp.record_event(end)
        name = plain(kernel.key.replace("<locals>", "locals").replace(".", "_"))
        self.events.append((name, begin, end))
        return result


def profiled(step, repeats: int = 5) -> dict | None:
    """Launches and microseconds of a step by kernel, by CUPTI; None without PyTorch."""
    try:
        import torch
    except ImportError:
        return None
    with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CUDA]) as profile:
        for _ in range(repeats):
            step()
        wp.synchronize()
    rows = defaultdict(lambda: [0.0, 0.0])
    for event in profile.events():
        if event.device_type == torch.autograd.DeviceType.CUDA:
            row = rows[plain(event.name)]
            row[0] += 1 / repeats
            row[1] += event.device_time / repeats
    return rows


def main() -> None:
    scene, worlds, steps, device = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    with wp.ScopedDevice(device):
        make = mujoco_scene if scene in MUJOCO else newton_scene
        step, result = make(scene, worlds)
        wp.synchronize()
        begin = time.perf_counter()
        step()
        wp.synchronize()
        first = time.perf_counter() - begin
        on_gpu = wp.get_device().is_cuda
        # Better code of what a CPU runs often comes after a while.
        while not on_gpu and time.perf_counter() - begin - first < 4.0:
            step()
        rows = {}
        for _ in range(5):
            with Launches(synchronous=not on_gpu) as launches:
                step()
            for name, row in launches.rows.items():
                rows[name] = [row[0], min(row[1], rows.get(name, row)[1]), row[2]]
        run = step
        if on_gpu:
            with wp.ScopedCapture() as capture:
                step()

            def run():
                wp.capture_launch(capture.graph)

        best = float("inf")
        for _ in range(3):
            wp.synchronize()
            begin = time.perf_counter()
            for _ in range(steps):
                run()
            wp.synchronize()
            best = min(best, (time.perf_counter() - begin) / steps)
        final = result().astype(float)
        found = profiled(run) if on_gpu else None
        if found:
            # Launches of no threads are none of the graph.
            sizes = {name: row[2] for name, row in rows.items()}
            rows = {name: [*row, sizes.get(name, 0)] for name, row in found.items()}
    report = {
        "first_s": first,
        "step_us": 1e6 * best,
        "launches": sum(row[0] for row in rows.values()),
        "finite": bool(np.isfinite(final).all()),
        "final": final.tolist(),
        "kernels": {name: [n, us, size / 1e6] for name, (n, us, size) in rows.items()},
    }
    print("RESULT" + json.dumps(report))


if __name__ == "__main__":
    main()
