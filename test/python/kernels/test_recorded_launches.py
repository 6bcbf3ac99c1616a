"""`wp.launch(..., record_cmd=True)`: packed once, changed in between, launched often."""

import ctypes
import gc
import threading

import numpy as np
import pytest

import warp as wp


@wp.kernel
def saxpy(a: float, x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = y[i] + a * x[i]


@wp.kernel
def store(v: wp.vec3, out: wp.array(dtype=wp.vec3)):
    out[wp.tid()] = v


@wp.kernel
def store_2d(out: wp.array2d(dtype=int)):
    i, j = wp.tid()
    out[i, j] = 10 * i + j + 1


def make(device, count=8):
    x, y = wp.ones(count, device=device), wp.zeros(count, device=device)
    command = wp.launch(saxpy, count, [2.0, x, y], device=device, record_cmd=True)
    return command, x, y


def test_recording_runs_nothing(device):
    command, _, y = make(device)
    assert isinstance(command, wp.Launch)
    assert command.kernel is saxpy
    assert command.device == wp.get_device(device)
    assert not y.numpy().any()
    command.launch()
    command.launch()
    assert (y.numpy() == 4.0).all()


def test_parameters_change(device):
    command, x, y = make(device)
    command.set_param_at_index(0, 3.0)
    command.launch()
    command.set_param_by_name("a", 10.0)
    command.launch()
    assert (y.numpy() == 13.0).all()
    other = wp.zeros(8, device=device)
    command.set_param_by_name("y", other)
    command.launch()
    assert (other.numpy() == 10.0).all()
    command.set_params([1.0, x, y])
    command.launch()
    assert (y.numpy() == 14.0).all()


def test_extents_change(device):
    command, _, y = make(device)
    command.set_dim(3)
    command.launch()
    assert y.numpy().tolist() == [2, 2, 2, 0, 0, 0, 0, 0]
    command.set_dim(0)
    command.launch()
    command.set_dim((8,))
    command.launch()
    assert y.numpy().tolist() == [4, 4, 4, 2, 2, 2, 2, 2]


def test_two_dimensions_and_strides(device):
    out = wp.zeros((3, 4), dtype=int, device=device)
    command = wp.launch(store_2d, (3, 4), [out], device=device, record_cmd=True)
    command.launch()
    expected = 10 * np.arange(3)[:, None] + np.arange(4) + 1
    assert (out.numpy() == expected).all()
    wide = wp.zeros((3, 8), dtype=int, device=device)
    command.set_param_at_index(0, wide[:, ::2])
    command.launch()
    assert (wide.numpy()[:, ::2] == expected).all()
    assert not wide.numpy()[:, 1::2].any()


def test_ctypes_values(device):
    command, x, y = make(device)
    command.set_param_at_index_from_ctype(0, ctypes.c_float(5.0))
    command.set_param_at_index_from_ctype(2, y.__ctype__())
    command.launch()
    assert (y.numpy() == 5.0).all()
    command.set_param_by_name_from_ctype("a", 1)
    command.set_params_from_ctypes([ctypes.c_float(2.0), x.__ctype__(), y.__ctype__()])
    command.launch()
    assert (y.numpy() == 7.0).all()
    out = wp.zeros(2, dtype=wp.vec3, device=device)
    command = wp.launch(store, 2, [wp.vec3(), out], device=device, record_cmd=True)
    command.set_param_at_index_from_ctype(0, (ctypes.c_float * 3)(1.0, 2.0, 3.0))
    command.launch()
    assert out.numpy().tolist() == [[1, 2, 3]] * 2
    with pytest.raises(TypeError, match="expects 12 bytes, but got 8"):
        command.set_param_at_index_from_ctype(0, (ctypes.c_float * 2)())


def test_arguments_stay_alive(device):
    command, x, y = make(device, 1000)
    del x
    gc.collect()
    others = [wp.full(1000, 9.0, device=device) for _ in range(10)]
    command.launch()
    assert (y.numpy() == 2.0).all()
    assert len(others) == 10


def test_errors(device):
    command, x, _ = make(device)
    with pytest.raises(ValueError, match="no parameter 'b', it has: a, x, y"):
        command.set_param_by_name("b", 1.0)
    with pytest.raises(IndexError):
        command.set_param_at_index(3, 1.0)
    with pytest.raises(IndexError):
        command.set_param_at_index(-1, 1.0)
    with pytest.raises(wp.WarpLaunchError, match="'x'"):
        command.set_param_by_name("x", 1.0)
    with pytest.raises(wp.WarpLaunchError):
        command.set_params([1.0, x, x, x])
    with pytest.raises(wp.WarpLaunchError):
        command.set_dim((1, 2, 3, 4, 5))
    with pytest.raises(wp.WarpLaunchError, match="has no gradients"):
        command.set_param_at_index(0, 1.0, adjoint=True)
    with pytest.raises(TypeError):
        command.launch(stream=1)
    with pytest.raises(TypeError):
        command.launch(nothing=None)
    command.launch(stream=None)


def test_large_launches_and_threads(device):
    count = 1 << 18
    commands = [make(device, count) for _ in range(4)]

    def work(command):
        for _ in range(25):
            command.launch()

    threads = [threading.Thread(target=work, args=(command,)) for command, _, _ in commands]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all((y.numpy() == 50.0).all() for _, _, y in commands)


@pytest.mark.cuda
def test_streams():
    command, _, y = make("cuda:0")
    stream = wp.Stream("cuda:0")
    wp.synchronize_device("cuda:0")
    command.launch(stream)
    command.launch(stream=stream)
    wp.synchronize_stream(stream)
    assert (y.numpy() == 4.0).all()
