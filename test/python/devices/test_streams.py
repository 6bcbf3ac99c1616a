"""Streams, events, several devices, threads and processes on CUDA."""

import multiprocessing
import os
import subprocess
import sys
import textwrap
import threading

import pytest

import warp as wp


@wp.kernel
def add_one(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = x[i] + 1.0


@wp.kernel
def relax(x: wp.array(dtype=float), y: wp.array(dtype=float), steps: int):
    i = wp.tid()
    value = x[i]
    for _ in range(steps):
        value = value * 0.5 + x[i] * 0.5
    y[i] = value


# ---- Streams and events --------------------------------------------------------------------------


@pytest.mark.cuda
def test_streams():
    device = wp.get_device("cuda:0")
    stream = wp.Stream(device, priority=-1)
    assert isinstance(wp.get_stream(device), wp.Stream)
    assert stream.priority <= 0 and stream.is_blocking and not stream.is_capturing
    assert stream.device is device and stream.__cuda_stream__() == (0, stream.cuda_stream)
    assert wp.Stream("cuda:0", priority=7).priority == 0
    borrowed = wp.Stream(device, cuda_stream=stream.cuda_stream)
    assert borrowed.cuda_stream == stream.cuda_stream
    with pytest.raises(TypeError, match="priority"):
        wp.Stream(device, priority="high")
    for make in (wp.Stream, wp.Event):
        with pytest.raises(RuntimeError, match="CUDA"):
            make("cpu")


@pytest.mark.cuda
def test_launches_are_asynchronous():
    device = wp.get_device("cuda:0")
    count = 1 << 20
    x, y = wp.full(count, 2.0, device=device), wp.zeros(count, device=device)
    stream = wp.Stream(device)
    wp.launch(relax, dim=count, inputs=[x, y, 1], device=device)
    wp.synchronize()
    done = wp.Event(device)
    wp.launch(relax, dim=count, inputs=[x, y, 100000], stream=stream)
    stream.record_event(done)
    assert not stream.is_complete and not done.is_complete
    wp.synchronize_event(done)
    assert stream.is_complete and done.is_complete
    wp.synchronize_stream(stream)
    wp.synchronize_device(device)


@pytest.mark.cuda
def test_order_across_streams():
    device = wp.get_device("cuda:0")
    count = 1 << 20
    first, second = wp.Stream(device), wp.Stream(device)
    for _ in range(5):
        x, y = wp.full(count, 2.0, device=device), wp.zeros(count, device=device)
        first.wait_stream(wp.get_stream(device))
        wp.launch(relax, dim=count, inputs=[x, y, 20000], stream=first)
        event = first.record_event()
        second.wait_event(event)
        wp.launch(add_one, dim=count, inputs=[y], stream=second)
        with wp.ScopedDevice(device):
            wp.wait_stream(second)
            wp.launch(add_one, dim=count, inputs=[y])
        assert (y.numpy() == 4.0).all()
    with wp.ScopedStream(first) as inner:
        assert wp.get_stream(device).cuda_stream == inner.cuda_stream
        z = wp.full(count, 1.0, device=device)
        wp.launch(relax, dim=count, inputs=[z, y, 20000], device=device)
    wp.wait_event(first.record_event())
    wp.launch(add_one, dim=count, inputs=[y], device=device)
    assert (y.numpy() == 2.0).all()
    with wp.ScopedStream(first, sync_exit=True):
        wp.launch(relax, dim=count, inputs=[x, y, 20000], device=device)
    wp.launch(add_one, dim=count, inputs=[y], device=device)
    assert (y.numpy() == 3.0).all()


@pytest.mark.cuda
def test_events_measure_time():
    device = wp.get_device("cuda:0")
    count = 1 << 20
    x, y = wp.full(count, 2.0, device=device), wp.zeros(count, device=device)
    wp.launch(relax, dim=count, inputs=[x, y, 1], device=device)
    times = []
    for steps in (1000, 50000):
        start, end = (wp.Event(device, enable_timing=True) for _ in range(2))
        wp.get_stream(device).record_event(start)
        wp.launch(relax, dim=count, inputs=[x, y, steps], device=device)
        wp.get_stream(device).record_event(end)
        times.append(wp.get_event_elapsed_time(start, end))
    assert 0.0 < times[0] < times[1]
    with pytest.raises(ValueError, match="interprocess"):
        wp.Event(device, enable_timing=True, interprocess=True)


@pytest.mark.cuda
def test_recorded_launches_take_a_stream():
    device = wp.get_device("cuda:0")
    x = wp.zeros(1000, device=device)
    stream = wp.Stream(device)
    command = wp.launch(add_one, dim=1000, inputs=[x], stream=stream, record_cmd=True)
    stream.wait_stream(wp.get_stream(device))
    command.launch()
    command.launch(stream=stream)
    stream.synchronize()
    assert (x.numpy() == 2.0).all()


# ---- Threads -------------------------------------------------------------------------------------


def test_sixteen_threads_launch_at_once(device):
    failures = []

    def run(number):
        try:
            with_stream = wp.get_device(device).is_cuda and number % 2
            stream = wp.Stream(device) if with_stream else None
            x = wp.full(1000, float(number), device=device)
            if stream is not None:
                stream.wait_stream(wp.get_stream(device))
            for _ in range(100):
                wp.launch(add_one, dim=1000, inputs=[x], device=device, stream=stream)
                y = wp.empty(1000, device=device)
                del y
            if not (x.numpy() == number + 100).all():
                failures.append(number)
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=run, args=(number,)) for number in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


# ---- Several devices -----------------------------------------------------------------------------


def two_devices():
    if wp.get_cuda_device_count() < 2:
        pytest.skip("one CUDA device")
    return wp.get_cuda_devices()[:2]


@pytest.mark.cuda
def test_two_devices():
    first, second = two_devices()
    arrays = [wp.full(1000, 1.0, device=device) for device in (first, second)]
    for x in arrays:
        wp.launch(add_one, dim=1000, inputs=[x], device=x.device)
    assert all((x.numpy() == 2.0).all() for x in arrays)
    with wp.ScopedDevice(second):
        assert wp.zeros(1).device == second and wp.get_device("cuda") == second
    with pytest.raises(wp.WarpLaunchError, match=r"the launch is on 'cuda:1'"):
        wp.launch(add_one, dim=1000, inputs=[arrays[0]], device=second)
    with pytest.raises(ValueError, match="expects a stream of 'cuda:0'"):
        wp.launch(add_one, dim=1, inputs=[arrays[0]], device=first, stream=wp.Stream(second))


@pytest.mark.cuda
@pytest.mark.parametrize("access", [False, True])
def test_copies_between_devices(access):
    first, second = two_devices()
    if access and not (
        wp.is_mempool_access_supported(first, second)
        and wp.is_mempool_access_supported(second, first)
    ):
        pytest.skip("the devices are not connected")
    count = 1 << 22
    with (
        wp.ScopedMempoolAccess(first, second, access),
        wp.ScopedMempoolAccess(second, first, access),
    ):
        x = wp.zeros(count, device=first)
        y = wp.zeros(count, device=second)
        for step in range(5):
            wp.launch(add_one, dim=count, inputs=[x], device=first)
            wp.copy(y, x)
            wp.launch(add_one, dim=count, inputs=[x], device=first)
            assert (y.numpy() == 2 * step + 1).all()
        wp.copy(x.reshape((2048, 2048))[:, ::2], y.reshape((2048, 2048))[:, 1::2])
        assert (x.numpy()[::2] == 9.0).all() and (x.numpy()[1::2] == 10.0).all()


@pytest.mark.cuda
def test_kernels_reach_peers():
    first, second = two_devices()
    if not wp.is_mempool_access_supported(first, second):
        pytest.skip("the devices are not connected")
    x = wp.full(1000, 5.0, device=first)
    assert not wp.can_access(second, x)
    with wp.ScopedMempoolAccess(first, second, True):
        assert wp.can_access(second, x) and wp.is_mempool_access_enabled(first, second)
        wp.synchronize()
        wp.launch(add_one, dim=1000, inputs=[x], device=second)
        wp.synchronize()
        assert (x.numpy() == 6.0).all()
    assert not wp.can_access(second, x)
    with wp.ScopedMempool(first, False), wp.ScopedPeerAccess(first, second, True):
        y = wp.full(1000, 7.0, device=first)
        wp.synchronize()
        assert second.can_access(first) and not first.can_access(second)
        wp.launch(add_one, dim=1000, inputs=[y], device=second)
        wp.synchronize()
        assert (y.numpy() == 8.0).all()


@pytest.mark.cuda
def test_mapped_devices():
    device = wp.get_device("cuda:0")
    same = wp.map_cuda_device("gpu", device.context)
    assert same is device and wp.get_device("gpu") is device
    assert wp.zeros(3, device="gpu").device == "cuda:0"
    with pytest.raises(RuntimeError, match="there is a device 'gpu'"):
        wp.map_cuda_device("gpu", device.context)
    wp.unmap_cuda_device("gpu")
    with pytest.raises(ValueError, match="no device 'gpu'"):
        wp.get_device("gpu")
    with pytest.raises(RuntimeError, match="no device was mapped"):
        wp.unmap_cuda_device("cuda:0")


# ---- Processes -----------------------------------------------------------------------------------


def run_script(folder, text):
    script = folder / "script.py"
    script.write_text(textwrap.dedent(text))
    package = os.path.dirname(os.path.dirname(wp.__file__))
    return subprocess.run(
        [sys.executable, str(script)],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": package},
    )


FAULT = """
    import warp as wp

    @wp.kernel
    def harmless(x: wp.array(dtype=float)):
        i = wp.tid()
        x[i] = x[i] + 1.0

    @wp.kernel
    def outside(x: wp.array(dtype=float), offset: int):
        x[wp.tid() + offset] = 1.0

    x = wp.zeros(10, device="cuda:0")
    wp.launch(harmless, dim=10, inputs=[x], device="cuda:0")
    wp.synchronize()
    wp.launch(outside, dim=10, inputs=[x, 2000000000], device="cuda:0")
    calls = [
        wp.synchronize,
        wp.synchronize,
        lambda: x.numpy(),
        lambda: wp.zeros(10, device="cuda:0"),
        lambda: wp.launch(harmless, dim=10, inputs=[x], device="cuda:0"),
        lambda: wp.synchronize_device("cuda:0"),
    ]
    for call in calls:
        try:
            call()
            print("no error")
        except RuntimeError as error:
            print("launched last: 'outside'" in str(error), str(error)[:100])
    y = wp.zeros(10, device="cpu")
    wp.launch(harmless, dim=10, inputs=[y], device="cpu")
    print("cpu", y.numpy().sum())
"""


@pytest.mark.cuda
def test_faults_are_reported_and_the_cpu_goes_on(tmp_path):
    result = run_script(tmp_path, FAULT)
    assert result.returncode == 0, result.stderr
    lines = result.stdout.splitlines()
    assert lines[-1] == "cpu 10.0"
    assert len(lines) == 7 and all(line.startswith("True ") for line in lines[:-1]), lines


FORK = """
    import os
    import warp as wp
    x = wp.zeros(10, device="cuda:0")
    child = os.fork()
    if child == 0:
        try:
            wp.zeros(10, device="cuda:0")
        except RuntimeError as error:
            print(error, flush=True)
        del x
        print("cpu", wp.full(10, 1.0, device="cpu").numpy().sum(), flush=True)
        os._exit(7)
    print("status", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    x.fill_(2.0)
    print("parent", x.numpy().sum())
"""


@pytest.mark.cuda
def test_forked_children_are_told_to_spawn(tmp_path):
    result = run_script(tmp_path, FORK)
    assert result.returncode == 0, result.stderr
    assert "forked" in result.stdout and "'spawn'" in result.stdout
    assert "cpu 10.0" in result.stdout and "status 7" in result.stdout
    assert "parent 20.0" in result.stdout


def child_sum(device, queue):
    x = wp.full(100, 3.0, device=device)
    wp.launch(add_one, dim=100, inputs=[x], device=device)
    queue.put(float(x.numpy().sum()))


def test_spawned_children_compute(device):
    wp.zeros(1, device=device)
    context = multiprocessing.get_context("spawn")
    queue = context.Queue()
    child = context.Process(target=child_sum, args=(device, queue))
    child.start()
    assert queue.get(timeout=120) == 400.0
    child.join()
    assert child.exitcode == 0


def child_adds(handle, event_handle, queue):
    x = wp.from_ipc_handle(handle, dtype=float, shape=100, device="cuda:0")
    wp.launch(add_one, dim=100, inputs=[x], device="cuda:0")
    event = wp.event_from_ipc_handle(event_handle, "cuda:0")
    wp.get_stream("cuda:0").record_event(event)
    wp.synchronize()
    queue.put("done")
    queue.close()
    queue.join_thread()


@pytest.mark.cuda
def test_arrays_and_events_of_another_process():
    with wp.ScopedMempool("cuda:0", False):
        x = wp.full(100, 3.0, device="cuda:0")
        larger = wp.full(200, 5.0, device="cuda:0")
    part = larger[100:]
    event = wp.Event("cuda:0", interprocess=True)
    wp.synchronize()
    assert len(x.ipc_handle()) == 64 and len(event.ipc_handle()) == 64
    context = multiprocessing.get_context("spawn")
    for array, before in ((x, 3.0), (part, 5.0)):
        queue = context.Queue()
        arguments = (array.ipc_handle(), event.ipc_handle(), queue)
        child = context.Process(target=child_adds, args=arguments)
        child.start()
        assert queue.get(timeout=120) == "done"
        child.join()
        wp.get_stream("cuda:0").wait_event(event)
        assert (array.numpy() == before + 1.0).all()
    assert (larger.numpy()[:100] == 5.0).all()
    pooled = wp.zeros(10, device="cuda:0")
    if pooled.memory_kind == wp.MemoryKind.CUDA_MEMPOOL:
        with pytest.raises(RuntimeError, match="no pool"):
            pooled.ipc_handle()
