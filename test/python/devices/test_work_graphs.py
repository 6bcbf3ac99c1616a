"""Work graphs as users write them: lattice Boltzmann, a wave, a rollout with a network in tiles."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

import warp as wp

FILE = Path(__file__).resolve().parents[3] / "benchmarks" / "_graph_scenes.py"
if not FILE.exists():
    pytest.skip("the benchmarks are not here", allow_module_level=True)
SPEC = importlib.util.spec_from_file_location("_graph_scenes", FILE)
scenes = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(scenes)

SCENES = {
    "lattice19": lambda: scenes.lattice3(19, 6),
    "lattice27": lambda: scenes.lattice3(27, 6),
    "wave": lambda: scenes.wave3(7),
    "rollout": lambda: scenes.rollout(64, steps=3),
}


@pytest.mark.parametrize("name", SCENES)
def test_steps_have_the_bits_of_eager_launches(device, name, monkeypatch):
    """A chain, a graph by dependencies and one with fused launches leave what eager launches do."""
    with wp.ScopedDevice(device):
        step, arrays = SCENES[name]()
        start = [array.numpy().copy() for array in arrays]

        def after(run):
            for array, values in zip(arrays, start, strict=True):
                array.assign(values)
            for _ in range(4):
                run()
            return [array.numpy() for array in arrays]

        expected = after(step)
        assert any((a != b).any() for a, b in zip(expected, start, strict=True))
        assert all(np.isfinite(array).all() for array in expected)
        operations = []
        for optimize, fuse in ((False, False), (True, False), (True, True)):
            monkeypatch.setattr(wp.config, "fuse_graphs", fuse)
            with wp.ScopedCapture(optimize=optimize) as capture:
                step()
            if optimize:
                operations.append(len(capture.graph.schedule().nodes))
            found = after(lambda graph=capture.graph: wp.capture_launch(graph))
            for a, b in zip(found, expected, strict=True):
                assert a.tobytes() == b.tobytes(), (optimize, fuse)
        assert operations[1] < operations[0]
