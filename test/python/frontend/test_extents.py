"""Extents of arrays at indices that are known at run time only."""

import numpy as np
import pytest

import warp as wp


@wp.func
def size(a: wp.array2d(dtype=wp.vec3)):
    n = int(1)
    for d in range(a.ndim):
        n *= a.shape[d]
    return n


@wp.kernel(module="unique")
def extents(
    a: wp.array3d(dtype=float), b: wp.array2d(dtype=wp.vec3), i: int, out: wp.array(dtype=int)
):
    out[0] = a.shape[i]
    out[1] = a[1:].shape[wp.int64(i)]
    out[2] = size(b)
    d = int(0)
    while d < 3:
        out[3] = out[3] * 10 + a.shape[d]
        d += 1


@pytest.mark.parametrize("mode", ["release", "debug"])
@pytest.mark.parametrize("i", [0, 1, 2, -1, -3])
def test_extents_at_run_time(device, monkeypatch, mode, i):
    """They are those that NumPy tells, also counted from the end."""
    monkeypatch.setattr(wp.config, "mode", mode)
    a = wp.zeros((2, 3, 4), dtype=float, device=device)
    b = wp.zeros((5, 6), dtype=wp.vec3, device=device)
    out = wp.zeros(4, dtype=int, device=device)
    wp.launch(extents, 1, [a, b, i, out], device=device)
    shape = np.zeros((2, 3, 4)).shape
    rest = np.zeros((2, 3, 4))[1:].shape
    assert out.numpy().tolist() == [shape[i], rest[i], 30, 234]


def test_an_axis_that_is_not_there_is_told_in_debug_mode(device, monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")
    a = wp.zeros((2, 3, 4), dtype=float, device=device)
    b, out = wp.zeros((1, 1), dtype=wp.vec3, device=device), wp.zeros(4, dtype=int, device=device)
    with pytest.raises(wp.WarpLaunchError, match=r"index \(3,\) is out of bounds"):
        wp.launch(extents, 1, [a, b, 3, out], device=device)
        wp.synchronize_device(device)
