"""Devices, scopes, timers."""

import threading
import time

import pytest

import warp as wp
from warp._src.devices import devices


def test_cpu_is_always_there():
    cpu = wp.get_device("cpu")
    assert wp.get_device(cpu) is cpu and cpu in wp.get_devices()
    assert cpu == "cpu" and str(cpu) == "cpu" and repr(cpu) == "'cpu'"
    assert cpu.is_cpu and not cpu.is_cuda and cpu.arch == 0 and cpu.name
    assert cpu.stream is None and cpu.context is None
    assert wp.is_cpu_available() and wp.is_device_available("cpu")
    assert wp.get_preferred_device() in wp.get_devices()


def test_absent_cuda_is_a_state():
    assert wp.is_cuda_available() == bool(wp.get_cuda_devices())
    assert wp.get_cuda_device_count() == len(wp.get_cuda_devices())
    if wp.is_cuda_available():
        return
    assert wp.get_cuda_driver_version() is None or wp.get_cuda_driver_version() > (0, 0)
    with pytest.raises(ValueError, match="no CUDA device: "):
        wp.get_device("cuda")
    with pytest.raises(RuntimeError, match="CUDA"):
        wp.Stream("cpu")


@pytest.mark.cuda
def test_cuda_device():
    device = wp.get_device("cuda:0")
    assert device.is_cuda and device.arch >= 50 and device.total_memory >= device.free_memory > 0
    assert wp.get_cuda_device() == device == "cuda:0"
    assert device.uuid.startswith("GPU-") and device.sm_count > 0


def test_default_device(device):
    former = wp.get_device()
    with wp.ScopedDevice(device) as inner:
        assert wp.get_device() is inner and wp.zeros(1).device == device
        with wp.ScopedDevice("cpu"):
            assert wp.zeros(1).device == "cpu"
        assert wp.get_device() == device
    assert wp.get_device() is former
    with pytest.raises(KeyError):
        with wp.ScopedDevice(device):
            raise KeyError
    assert wp.get_device() is former


def test_synchronize(device):
    x = wp.zeros(1000, dtype=float, device=device)
    waits = (wp.synchronize, wp.synchronize_device, wp.synchronize_stream)
    for number, wait in enumerate(waits, 1):
        x.fill_(float(number))
        wait(*([device] if number > 1 else []))
        assert x.device.is_cpu or x.device.stream.is_complete
        assert (x.numpy() == number).all()


def test_timer_prints_one_line(capsys):
    times = {}
    with wp.ScopedTimer("work", dict=times) as timer:
        time.sleep(0.002)
        with wp.ScopedTimer("part", dict=times, synchronize=True):
            pass
    lines = capsys.readouterr().out.splitlines()
    assert [line.split(" took ")[0] for line in lines] == ["    part", "work"]
    assert lines[1].endswith(" ms")
    assert times["work"] == [timer.elapsed] and timer.elapsed >= 2.0
    assert len(times["part"]) == 1


def test_timer_can_be_silent(capsys):
    with wp.ScopedTimer("a", active=False) as inactive, wp.ScopedTimer("b", print=False) as silent:
        pass
    assert capsys.readouterr().out == "" and inactive.elapsed == 0.0 and silent.elapsed > 0.0


def test_an_error_of_the_block_goes_before_one_of_the_device(monkeypatch):
    def failing():
        raise wp.WarpError("the device does not answer")

    depth = wp.ScopedTimer.indent
    for kind, problem in ((ValueError, ValueError("of the block")), (wp.WarpError, None)):
        with pytest.raises(kind, match="of the block" if problem else "not answer"):
            with wp.ScopedTimer("timed", synchronize=True, print=False):
                monkeypatch.setattr("warp._src.devices.devices.synchronize", failing)
                if problem:
                    raise problem
        monkeypatch.undo()
    assert wp.ScopedTimer.indent == depth


def test_modules_and_options():
    module = wp.get_module("some.module")
    assert wp.get_module("some.module") is module
    wp.set_module_options({"fast_math": True, "max_unroll": 4}, module)
    options = wp.get_module_options(module)
    assert options["fast_math"] is True and options["max_unroll"] == 4
    assert wp.get_module_options()["fast_math"] is wp.config.fast_math
    with pytest.warns(UserWarning, match="no module option 'fast_maths'"):
        wp.set_module_options({"fast_maths": True}, module)
    assert wp.get_module_options(module)["fast_maths"] is True
    with pytest.raises(TypeError):
        wp.set_module_options({"fast_math": "yes"}, module)


def test_public_names():
    names = dir(wp)
    for name in ("array", "launch", "vec3", "sin", "types", "config"):
        assert name in names and getattr(wp, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = wp.nothing


@pytest.mark.cuda
def test_streams_and_events():
    device = wp.get_device("cuda:0")
    stream = wp.Stream(device)
    assert stream.device is device and stream.cuda_stream != wp.get_stream(device).cuda_stream
    x = wp.zeros(1000, device=device)
    with wp.ScopedStream(stream):
        assert wp.get_stream(device).cuda_stream == stream.cuda_stream
        start, end = (wp.Event(device, enable_timing=True) for _ in range(2))
        wp.record_event(start)
        x.fill_(3.0)
        wp.record_event(end)
    assert wp.get_stream(device).cuda_stream != stream.cuda_stream
    wp.synchronize_stream(stream)
    assert wp.get_event_elapsed_time(start, end) >= 0.0 and end.is_complete
    assert (x.numpy() == 3.0).all()
    with wp.ScopedStream(None) as nothing:
        assert nothing is None
    wp.wait_stream(stream)
    wp.wait_event(end)


def test_a_default_device_of_one_thread(device):
    """Other threads keep that of the process, also where they set it meanwhile."""
    process, found = wp.get_device(), []

    def other():
        found.append(wp.get_device())
        with wp.ScopedDevice("cpu"):
            found.append(wp.zeros(1).device)
        found.append(wp.zeros(1).device)

    with devices.OwnDefault(wp.get_device(device)):
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        assert wp.get_device() is wp.zeros(1).device is wp.get_device(device)
        with wp.ScopedDevice("cpu"):
            assert wp.zeros(1).device.is_cpu
        assert wp.zeros(1).device is wp.get_device(device)
        if str(device).startswith("cuda"):
            assert wp.get_device("cuda") is wp.get_device(device)
    assert found == [process, wp.get_device("cpu"), process]
    assert wp.get_device() is wp.zeros(1).device is process


@pytest.mark.parametrize(
    "name",
    [
        "is_concurrent_managed_access_supported",
        "is_cpu_gpu_atomic_supported",
        "is_cpu_memory_access_from_gpu_supported",
        "is_gpu_memory_access_from_cpu_supported",
        "is_managed_memory_supported",
    ],
)
def test_what_memory_a_device_shares(device, name):
    found = getattr(wp.get_device(device), name)
    assert type(found) is bool and getattr(wp.get_device("cpu"), name) is False
