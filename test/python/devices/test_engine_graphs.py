"""Steps of mujoco_warp as graphs: the bits of eager steps, where the package is installed."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import warp as wp

mujoco = pytest.importorskip("mujoco")
mujoco_warp = pytest.importorskip("mujoco_warp")

SCENES = {"humanoid": "humanoid/humanoid.xml", "collision": "collision.xml"}


def arrays_of(data, prefix=""):
    """The arrays of a state by name."""
    found = {}
    for field in dataclasses.fields(data):
        value = getattr(data, field.name)
        if isinstance(value, wp.array) and value.size and value.is_contiguous:
            found[prefix + field.name] = value
        elif dataclasses.is_dataclass(value):
            found.update(arrays_of(value, f"{prefix}{field.name}."))
    return found


@pytest.mark.parametrize("name", SCENES)
def test_steps_have_the_bits_of_eager_steps(name, monkeypatch):
    """On a CPU; threads of a GPU add floats in no order, in eager steps neither."""
    path = Path(mujoco_warp.__file__).parent / "test_data" / SCENES[name]
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    with wp.ScopedDevice("cpu"):
        m, d = mujoco_warp.put_model(model), mujoco_warp.put_data(model, data, nworld=1)
        m.opt.warn_overflow = 0
        arrays = arrays_of(d)
        start = {key: array.numpy().copy() for key, array in arrays.items()}

        def after(run):
            for key, array in arrays.items():
                array.assign(start[key])
            for _ in range(20):
                run()
            return {key: arrays[key].numpy().copy() for key in ("qpos", "qvel", "qacc", "time")}

        expected = after(lambda: mujoco_warp.step(m, d))
        assert np.isfinite(expected["qpos"]).all()
        assert not np.array_equal(expected["qpos"], start["qpos"])
        for optimize, fuse in ((False, False), (True, False), (True, True)):
            monkeypatch.setattr(wp.config, "fuse_graphs", fuse)
            with wp.ScopedCapture(optimize=optimize) as capture:
                mujoco_warp.step(m, d)
            found = after(lambda graph=capture.graph: wp.capture_launch(graph))
            for key, value in expected.items():
                assert found[key].tobytes() == value.tobytes(), (optimize, fuse, key)
        assert capture.graph.schedule().fusions
