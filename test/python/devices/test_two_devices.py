"""Two CUDA devices in one process: copies, launches, streams and access to a peer's memory."""

import threading

import numpy as np
import pytest

import warp as wp

N = 100_003


@wp.kernel
def scale(x: wp.array(dtype=float), y: wp.array(dtype=float), s: float):
    i = wp.tid()
    y[i] = s * x[i]


@wp.kernel
def total(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(out, 0, x[i])


def numbers(n=N, seed=3):
    return np.random.default_rng(seed).random(n, dtype=np.float32)


@pytest.fixture(params=["forth", "back"])
def pair(two_devices, request):
    return two_devices if request.param == "forth" else two_devices[::-1]


def test_devices_differ(two_devices):
    first, second = map(wp.get_device, two_devices)
    assert first != second and first.uuid != second.uuid and first.context != second.context
    assert [device.ordinal for device in (first, second)] == [0, 1]


def test_copy(pair):
    here, there = pair
    data = numbers()
    x = wp.array(data, dtype=float, device=here)
    y = wp.zeros(N, dtype=float, device=there)
    wp.copy(y, x)
    assert (y.numpy() == data).all()
    z = wp.clone(x, device=there)
    assert z.device == there and (z.numpy() == data).all()


def test_copy_of_a_part_and_with_strides(pair):
    here, there = pair
    data = numbers(600).reshape(20, 30)
    x = wp.array(data, dtype=float, device=here)
    y = wp.zeros((30, 20), dtype=float, device=there)
    wp.copy(y, x.transpose())
    assert (y.numpy() == data.T).all()
    z = wp.zeros((10, 30), dtype=float, device=there)
    wp.copy(z, x[::2])
    assert (z.numpy() == data[::2]).all()


def test_copy_waits_for_what_came_before(pair):
    here, there = pair
    x = wp.ones(N, dtype=float, device=here)
    y = wp.zeros(N, dtype=float, device=there)
    for _ in range(20):
        wp.launch(scale, N, [x, x, 2.0], device=here)
        wp.copy(y, x)
        wp.launch(scale, N, [y, y, 0.5], device=there)
        wp.copy(x, y)
    assert (x.numpy() == 1.0).all()


def test_launch_on_each(two_devices):
    """One kernel, loaded on both; each stream runs its own work."""
    data = numbers()
    for device in two_devices:
        x, y = wp.array(data, device=device), wp.zeros(N, device=device)
        wp.launch(scale, N, [x, y, 3.0], device=device)
        result = wp.zeros(1, device=device)
        wp.launch(total, N, [y, result], device=device)
        exact = 3.0 * data.sum(dtype=np.float64)
        assert result.numpy()[0] == pytest.approx(exact, rel=1e-5)


def test_scopes_and_defaults(two_devices):
    first, second = two_devices
    with wp.ScopedDevice(second):
        x = wp.ones(10)
        assert x.device == second
        with wp.ScopedDevice(first):
            assert wp.ones(1).device == first
        wp.launch(scale, 10, [x, x, 2.0])
    assert (x.numpy() == 2.0).all()


def test_stream_of_one_waits_for_the_other(two_devices):
    first, second = two_devices
    streams = [wp.Stream(device) for device in two_devices]
    x, y = wp.ones(N, device=first), wp.zeros(N, device=second)
    wp.synchronize()
    with wp.ScopedStream(streams[0]):
        for _ in range(10):
            wp.launch(scale, N, [x, x, 2.0], device=first)
        done = streams[0].record_event(wp.Event(first))
    streams[1].wait_event(done)
    with wp.ScopedStream(streams[1]):
        wp.copy(y, x)
    wp.synchronize_stream(streams[1])
    assert (y.numpy() == 1024.0).all()


def test_threads_with_a_device_each(two_devices):
    results = {}

    def work(device):
        # Every device is named: the default device is the process's.
        x = wp.ones(N, device=device)
        for _ in range(50):
            wp.launch(scale, N, [x, x, 1.5], device=device)
            wp.launch(scale, N, [x, x, 1.0 / 1.5], device=device)
        results[device] = x.numpy()

    threads = [threading.Thread(target=work, args=(device,)) for device in two_devices]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for device in two_devices:
        np.testing.assert_allclose(results[device], 1.0, rtol=1e-4)


def test_kernel_reads_the_memory_of_a_peer(pair):
    """`peer` reaches what lies on `owner`: plain memory by one setting, pools by another."""
    owner, peer = pair
    if not wp.is_peer_access_supported(owner, peer):
        pytest.skip(f"{peer} cannot reach the memory of {owner}")
    if not wp.is_mempool_access_supported(owner, peer):
        pytest.skip(f"{peer} cannot reach the pool of {owner}")
    data = numbers()
    former = wp.is_peer_access_enabled(owner, peer), wp.is_mempool_access_enabled(owner, peer)
    try:
        wp.set_peer_access_enabled(owner, peer, True)
        wp.set_mempool_access_enabled(owner, peer, True)
        assert wp.is_peer_access_enabled(owner, peer)
        assert wp.is_mempool_access_enabled(owner, peer)
        x = wp.array(data, dtype=float, device=owner)
        y = wp.zeros(N, dtype=float, device=peer)
        wp.synchronize()
        wp.launch(scale, N, [x, y, 2.0], device=peer)
        assert (y.numpy() == 2 * data).all()
    finally:
        wp.set_peer_access_enabled(owner, peer, former[0])
        wp.set_mempool_access_enabled(owner, peer, former[1])
