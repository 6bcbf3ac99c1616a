"""Values compared with NVIDIA Warp, where WARP_PEER_PYTHON names a Python that has it."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest

import programs

PEER = os.environ.get("WARP_PEER_PYTHON", "")
PROGRAM = Path(__file__).parents[1] / "support" / "peer_program.py"
EXACT = [
    "int_div",
    "int_floordiv",
    "int_mod",
    "int_shift",
    "int_bits",
    "int_sign",
    "min_max",
    "rounding",
    "floor_ceil",
    "signs",
    "remainder",
    "clamped",
    "tests",
    "skew_matrix",
    "zero_normal",
    "uniform",
    "integer",
    "bounded",
    "raw",
    "seeded",
]
CLOSE = [
    "blend",
    "inverse_trig",
    "mat_row_major",
    "products",
    "picks",
    "product",
    "rpy",
    "slerp",
    "from_matrix",
    "axis_angle",
    "rotated",
    "matrix",
    "identity",
    "moved",
    "pose",
    "ranged",
    "normal",
]
pytestmark = pytest.mark.skipif(not PEER, reason="WARP_PEER_PYTHON names no Python")


@pytest.fixture(scope="module")
def peer(tmp_path_factory):
    folder = tmp_path_factory.mktemp("peer")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment["WARP_CACHE_PATH"] = str(folder / "cache")
    command = [PEER, PROGRAM, folder / "peer.npz", "cpu"]
    subprocess.run(command, check=True, capture_output=True, env=environment)
    return np.load(folder / "peer.npz")


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    made = {}

    def results(device):
        if device not in made:
            path = tmp_path_factory.mktemp("ours") / "ours.npz"
            status, _, err = programs.run(PROGRAM, path, device)
            assert status == 0, err
            made[device] = np.load(path)
        return made[device]

    return results


@pytest.mark.parametrize("name", EXACT)
def test_equal(peer, ours, device, name):
    np.testing.assert_array_equal(ours(device)[name], peer[name])


@pytest.mark.parametrize("name", CLOSE)
def test_close(peer, ours, device, name):
    a, b = ours(device)[name].astype(np.float64), peer[name].astype(np.float64)
    np.testing.assert_allclose(a, b, rtol=2e-5, atol=4e-6)


def test_everything_is_compared(peer):
    assert sorted(peer.files) == sorted(EXACT + CLOSE)
