"""Functions that stay pass values in registers on GPUs: by what the assembler says of each."""

import os
import re
import shutil
import subprocess

import pytest

import warp as wp

BUDGET = {"inline_budget": 64}


def assembler():
    """The assembler of a CUDA toolkit, or None."""
    return shutil.which("ptxas", path=os.environ["PATH"] + ":/usr/local/cuda/bin")


@wp.struct
class Pose:
    """Numbers of several kinds, and what is made of them."""

    turn: wp.mat33
    place: wp.vec3
    scale: float
    count: int


@wp.func
def moved(pose: Pose, values: wp.array(dtype=float), i: int):
    """Gets and returns a struct, and returns a vector and a number beside it."""
    turn = pose.turn * pose.turn * pose.turn
    turn = turn * turn * turn
    place = turn * pose.place + wp.vec3(values[i], values[i + 1], values[i + 2])
    result = Pose()
    result.turn = turn * pose.scale
    result.place = turn * place
    result.scale = wp.dot(place, place)
    result.count = pose.count + 1
    return result, wp.cross(place, pose.place), wp.length(place)


@wp.func
def twice(pose: Pose, values: wp.array(dtype=float), i: int):
    """Calls a function that stays, and stays itself."""
    first, cross, length = moved(pose, values, i)
    second, other, more = moved(first, values, i + 3)
    second.turn = second.turn * first.turn * length
    return second, cross + other, more


@wp.kernel(module="unique", module_options=BUDGET)
def poses(turns: wp.array(dtype=wp.mat33), values: wp.array(dtype=float),
          y: wp.array(dtype=wp.vec3), z: wp.array(dtype=float)):  # fmt: skip
    i = wp.tid()
    pose = Pose()
    pose.turn = turns[i]
    pose.place = wp.vec3(1.0, 2.0, 3.0)
    pose.scale = 0.5
    a, b, c = twice(pose, values, 6 * i)
    d, e, f = twice(a, values, 6 * i + 6)
    y[i] = b + e + d.place + d.turn[0]
    z[i] = c + f + d.scale + float(d.count)


@pytest.mark.skipif(assembler() is None, reason="no CUDA toolkit")
def test_functions_have_no_memory_of_their_own(tmp_path):
    """Structs, matrices and several results take registers: no function has a stack frame."""
    source = tmp_path / "poses.ptx"
    source.write_text(poses.ir("ptx", arch=90))
    command = [assembler(), "-arch=sm_90a", "-v", source, "-o", tmp_path / "poses.cubin"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = dict(
        re.findall(r"Function properties for (\w+)\n?\s*(\d+ bytes stack frame, .*)", done.stderr)
    )
    none = "0 bytes stack frame, 0 bytes spill stores, 0 bytes spill loads"
    assert found == {"poses": none, "moved": none, "twice": none}
