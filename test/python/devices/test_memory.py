"""Memory: pools, pinned arrays, allocators, the tracker, running out of it."""

import ctypes

import numpy as np
import pytest

import warp as wp


@wp.kernel
def add_one(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = x[i] + 1.0


# ---- Tracker -------------------------------------------------------------------------------------


def allocate_here(device):
    return wp.zeros(1000, dtype=float, device=device)


def test_tracker_names_places(device):
    texts = []
    with wp.ScopedMemoryTracker("outer", report_func=texts.append) as tracker:
        tracker.clear()
        kept = allocate_here(device)
        with wp.ScopedMemoryTracker("inner", print=False):
            other = wp.zeros(10, dtype=float, device=device)
            freed = wp.empty(5000, dtype=float, device=device)
            del freed
    text = texts[0]
    assert "outer: test_memory.py:" in text and "(allocate_here)" in text
    assert "outer/inner: test_memory.py:" in text
    assert f"{device}: 3.9 KiB now, 23.5 KiB peak, 3 allocations, 1 freed" in text
    assert text.index("3.9 KiB  ") < text.index("40 bytes  ")
    assert kept.shape == (1000,) and other.shape == (10,)


def test_tracker_is_off_by_default(capsys):
    from warp._src.devices import allocators

    assert not allocators.special
    with wp.ScopedMemoryTracker(active=False):
        assert not allocators.special
    with pytest.raises(RuntimeError, match="no memory is tracked"):
        wp.print_memory_report()
    assert capsys.readouterr().out == ""


def test_tracking_as_a_setting(config, capsys):
    config.track_memory = True
    x = wp.zeros(123, device="cpu")
    wp.print_memory_report(sort="chronological")
    config.track_memory = False
    out = capsys.readouterr().out
    assert "test_memory.py:" in out and "492 bytes" in out and x.size == 123
    with pytest.raises(ValueError, match="'sort'"):
        wp.ScopedMemoryTracker().report(sort="name")


# ---- Out of memory -------------------------------------------------------------------------------


def test_out_of_memory_names_request_free_and_users(device):
    with wp.ScopedMemoryTracker(print=False):
        kept = allocate_here(device)
        with pytest.raises(wp.WarpError) as caught:
            wp.empty((1 << 15, 1 << 30), dtype=wp.int8, device=device)
    text = str(caught.value)
    assert isinstance(caught.value, MemoryError)
    assert text.startswith(f"out of memory on '{device}', requested 32.0 TiB, free ")
    assert "largest users: " in text and "(allocate_here)" in text
    wp.launch(add_one, dim=kept.size, inputs=[kept], device=device)
    assert (kept.numpy() == 1.0).all()


# ---- The CPU -------------------------------------------------------------------------------------


def test_the_cpu_has_no_pool():
    assert not wp.is_mempool_supported("cpu") and not wp.is_mempool_enabled("cpu")
    assert not wp.is_peer_access_supported("cpu", "cpu")
    wp.set_mempool_enabled("cpu", False)
    for call in (
        lambda: wp.set_mempool_enabled("cpu", True),
        lambda: wp.set_mempool_release_threshold("cpu", 0),
        lambda: wp.get_mempool_used_mem_current("cpu"),
        lambda: wp.set_peer_access_enabled("cpu", "cpu", True),
    ):
        with pytest.raises(ValueError, match="CUDA device"):
            call()
    for call in (
        lambda: wp.set_device_allocator("cpu", None),
        lambda: wp.ScopedAllocator("cpu", None),
        lambda: wp.zeros(3, device="cpu").ipc_handle(),
        lambda: wp.event_from_ipc_handle(bytes(64), "cpu"),
    ):
        with pytest.raises(RuntimeError, match="CUDA device"):
            call()


def test_access_to_host_arrays():
    x = wp.zeros(3, device="cpu")
    assert wp.can_access("cpu", x) and x.memory_kind in (wp.MemoryKind.HOST,)
    with pytest.raises(TypeError, match="expects Warp arrays, but got 'int'"):
        wp.can_access("cpu", 3)
    annotation = wp.array(dtype=float)
    assert annotation.memory_kind is wp.MemoryKind.UNKNOWN
    with pytest.raises(TypeError, match="concrete Warp array"):
        wp.can_access("cpu", annotation)


# ---- Pools ---------------------------------------------------------------------------------------


@pytest.mark.cuda
def test_pool_settings():
    device = wp.get_device("cuda:0")
    if not device.is_mempool_supported:
        pytest.skip("no memory pool")
    assert device.is_mempool_enabled and wp.is_mempool_enabled(device)
    before = wp.get_mempool_used_mem_current(device)
    x = wp.zeros(1 << 20, dtype=wp.int8, device=device)
    assert wp.get_mempool_used_mem_current(device) >= before + (1 << 20)
    assert wp.get_mempool_used_mem_high(device) >= wp.get_mempool_used_mem_current(device)
    assert x.memory_kind == wp.MemoryKind.CUDA_MEMPOOL
    saved = wp.get_mempool_release_threshold(device)
    wp.set_mempool_release_threshold(device, 12345678)
    assert wp.get_mempool_release_threshold(device) == 12345678
    wp.set_mempool_release_threshold(device, 0.5)
    half = device.total_memory // 2
    assert abs(wp.get_mempool_release_threshold(device) - half) <= 1
    wp.set_mempool_release_threshold(device, saved)
    with wp.ScopedMempool(device, False):
        assert not wp.is_mempool_enabled(device)
        y = wp.full(100, 7.0, device=device)
        assert y.memory_kind == wp.MemoryKind.CUDA_DEVICE
    assert wp.is_mempool_enabled(device) and (y.numpy() == 7.0).all()


# ---- Freed memory --------------------------------------------------------------------------------


@wp.kernel
def spin_then_add(x: wp.array(dtype=float), y: wp.array(dtype=float), steps: int):
    i = wp.tid()
    value = x[i]
    for _ in range(steps):
        value = value * 0.5 + x[i] * 0.5
    y[i] = value


@pytest.mark.cuda
@pytest.mark.parametrize("pooled", [True, False])
def test_freed_arrays_do_not_race_with_streams(pooled):
    """A long kernel on another stream reads an array that is freed and its memory written over."""
    device = wp.get_device("cuda:0")
    count, steps = 1 << 20, 20000
    with wp.ScopedMempool(device, pooled and device.is_mempool_supported):
        streams = [wp.Stream(device) for _ in range(3)]
        results = [wp.zeros(count, device=device) for _ in streams]
        warm = wp.full(count, 1.0, device=device)
        wp.launch(spin_then_add, dim=count, inputs=[warm, results[0], 1], device=device)
        wp.synchronize()
        for _ in range(3):
            for stream, result in zip(streams, results, strict=True):
                x = wp.full(count, 3.0, device=device)
                stream.wait_stream(wp.get_stream(device))
                wp.launch(spin_then_add, dim=count, inputs=[x, result, steps], stream=stream)
                del x
                others = [wp.full(count, -1.0, device=device) for _ in range(4)]
                del others
            wp.synchronize()
            for result in results:
                assert (result.numpy() == 3.0).all()


@pytest.mark.cuda
def test_freed_arrays_do_not_race_with_borrowed_streams():
    """The same on a stream that does not keep its order with others by itself."""
    device = wp.get_device("cuda:0")
    driver = ctypes.CDLL("libcuda.so.1")
    handle = ctypes.c_void_p()
    wp.zeros(1, device=device)
    assert driver.cuStreamCreate(ctypes.byref(handle), 1) == 0
    stream = wp.Stream(device, cuda_stream=handle.value)
    assert not stream.is_blocking
    count = 1 << 20
    result = wp.zeros(count, device=device)
    for _ in range(5):
        x = wp.full(count, 3.0, device=device)
        stream.wait_stream(wp.get_stream(device))
        wp.launch(spin_then_add, dim=count, inputs=[x, result, 20000], stream=stream)
        del x
        others = [wp.full(count, -1.0, device=device) for _ in range(4)]
        del others
        assert (result.numpy() == 3.0).all()
    del stream
    assert driver.cuStreamDestroy_v2(handle) == 0


@pytest.mark.cuda
def test_freed_pinned_memory_is_not_reused_too_early():
    device = wp.get_device("cuda:0")
    count = 1 << 22
    for step in range(5):
        source = wp.full(count, float(step), device="cpu", pinned=True)
        target = wp.empty(count, device=device)
        wp.copy(target, source)
        del source
        other = wp.full(count, -1.0, device="cpu", pinned=True)
        assert (target.numpy() == step).all() and other.pinned


# ---- Copies --------------------------------------------------------------------------------------


@pytest.mark.cuda
@pytest.mark.parametrize("pinned", [True, False])
def test_copies_to_the_host_are_complete_when_read(pinned):
    device = wp.get_device("cuda:0")
    count = 1 << 22
    x = wp.zeros(count, device=device)
    host = wp.empty(count, device="cpu", pinned=pinned)
    assert host.pinned == pinned
    for step in range(5):
        wp.launch(add_one, dim=count, inputs=[x], device=device)
        wp.copy(host, x)
        assert (host.numpy() == step + 1).all()


@pytest.mark.cuda
def test_numpy_waits_for_all_streams():
    device = wp.get_device("cuda:0")
    count = 1 << 20
    x, y = wp.full(count, 2.0, device=device), wp.zeros(count, device=device)
    stream = wp.Stream(device)
    stream.wait_stream(wp.get_stream(device))
    wp.launch(spin_then_add, dim=count, inputs=[x, y, 50000], stream=stream)
    assert (y.numpy() == 2.0).all()


# ---- Allocators ----------------------------------------------------------------------------------


class Counting:
    """Hands on to another allocator, by default of managed memory, and counts."""

    def __init__(self, inner=None):
        self.inner = inner or wp.CudaManagedAllocator()
        self.live = {}

    def allocate(self, size_in_bytes):
        pointer = self.inner.allocate(size_in_bytes)
        self.live[pointer] = size_in_bytes
        return pointer

    def deallocate(self, ptr, size_in_bytes):
        assert self.live.pop(ptr) == size_in_bytes
        self.inner.deallocate(ptr, size_in_bytes)


def test_allocator_of_a_device(device):
    device = wp.get_device(device)
    allocator = device.get_allocator()
    assert isinstance(allocator, wp.Allocator) and allocator is device.default_allocator
    ptr = allocator.allocate(400)
    x = wp.array(ptr=ptr, shape=100, dtype=float, device=device)
    x.fill_(2.0)
    assert (x.numpy() == 2.0).all()
    other = allocator.allocate(400)
    assert other != ptr
    allocator.deallocate(ptr, 400)
    allocator.deallocate(other, 400)
    with pytest.raises(ValueError, match="no memory at"):
        allocator.deallocate(ptr, 400)


@pytest.mark.cuda
def test_pinned_allocator():
    allocator = wp.get_device("cpu").get_allocator(pinned=True)
    ptr = allocator.allocate(64)
    assert ptr
    allocator.deallocate(ptr, 64)


@pytest.mark.cuda
def test_wrapped_allocator():
    device = wp.get_device("cuda:0")
    allocator = Counting(device.default_allocator)
    with wp.ScopedAllocator(device, allocator):
        assert device.get_allocator() is allocator
        x = wp.ones(100, dtype=float, device=device)
    assert device.get_allocator() is device.default_allocator
    assert (x.numpy() == 1.0).all() and list(allocator.live.values()) == [400]
    del x
    assert not allocator.live


@pytest.mark.cuda
def test_custom_allocator():
    device = wp.get_device("cuda:0")
    allocator = Counting()
    assert isinstance(allocator, wp.Allocator)
    with wp.ScopedAllocator(device, allocator):
        x = wp.zeros(100, dtype=float, device=device)
        assert list(allocator.live.values()) == [400]
        assert wp.get_device_allocator(device) is allocator
        host = wp.zeros(100, device="cpu")
    assert wp.get_device_allocator(device) is None
    assert x.memory_kind == wp.MemoryKind.CUDA_MANAGED and host.device == "cpu"
    wp.launch(add_one, dim=100, inputs=[x], device=device)
    assert (x.numpy() == 1.0).all()
    view = x[10:20]
    del x
    assert allocator.live and (view.numpy() == 1.0).all()
    del view
    assert not allocator.live
    with pytest.raises(TypeError, match="'allocate'"):
        wp.set_device_allocator(device, object())
    wp.set_cuda_allocator(allocator)
    y = wp.zeros(10, device=device)
    assert len(allocator.live) == 1
    wp.set_cuda_allocator(None)
    z = wp.zeros(10, device=device)
    assert len(allocator.live) == 1 and z.size == y.size


@pytest.mark.cuda
def test_managed_memory_is_read_by_the_host():
    device = wp.get_device("cuda:0")
    with wp.ScopedAllocator(device, wp.CudaManagedAllocator()):
        x = wp.full(1000, 4.0, device=device)
    wp.launch(add_one, dim=1000, inputs=[x], device=device)
    wp.synchronize()
    assert wp.can_access("cpu", x)
    seen = np.ctypeslib.as_array((ctypes.c_float * 1000).from_address(x.ptr))
    assert (seen == 5.0).all()
