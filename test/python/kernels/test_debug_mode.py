"""In debug mode an access out of bounds names kernel, line, array, index and shape."""

import numpy as np
import pytest

import warp as wp
from warp.extend import errors


@pytest.fixture
def debug(monkeypatch):
    monkeypatch.setattr(wp.config, "mode", "debug")


def check_blamed(kernel, dim, inputs, device, *words, line="# here"):
    with pytest.raises(errors.WarpError) as caught:
        wp.launch(kernel, dim, inputs, device=device)
        wp.synchronize_device(device)
    message = str(caught.value)
    for word in (kernel.key, *words):
        assert word in message, f"'{word}' is not in: {message}"
    number = int(message.split("test_debug_mode.py:")[1].split(":")[0].split()[0])
    with open(__file__, encoding="utf-8") as file:
        assert line in file.readlines()[number - 1], message


def test_load(device, debug):
    @wp.kernel
    def read(values: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = values[i + 3]  # here

    values, out = (wp.zeros(10, dtype=float, device=device) for _ in range(2))
    check_blamed(read, 8, [values, out], device, "'values'", "10")


def test_store_and_rank_two(device, debug):
    @wp.kernel
    def write(grid: wp.array2d(dtype=wp.vec3)):
        i, j = wp.tid()
        grid[i, j + 5] = wp.vec3(1.0, 2.0, 3.0)  # here

    grid = wp.zeros((4, 7), dtype=wp.vec3, device=device)
    check_blamed(write, (4, 3), [grid], device, "'grid'", "4", "7")
    assert (grid.numpy()[:, :5] == 0.0).all()


def test_atomic_and_negative_index(device, debug):
    @wp.kernel
    def add(total: wp.array(dtype=float)):
        i = wp.tid()
        wp.atomic_add(total, i - 100, 1.0)  # here

    check_blamed(add, 1, [wp.zeros(4, dtype=float, device=device)], device, "'total'", "-100", "4")


def test_access_inside_a_function(device, debug):
    @wp.func
    def fetch(a: wp.array(dtype=float), k: int):
        return a[k]  # here

    @wp.kernel
    def outer(source: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = fetch(source, 50)

    values, out = (wp.zeros(10, dtype=float, device=device) for _ in range(2))
    check_blamed(outer, 1, [values, out], device, "50", "10")


def test_right_programs_run_and_negative_indices_wrap(device, debug):
    @wp.kernel
    def fine(a: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = a[-1 - i]

    a = wp.array(np.arange(5, dtype=np.float32), dtype=float, device=device)
    out = wp.zeros(5, dtype=float, device=device)
    wp.launch(fine, 5, [a, out], device=device)
    assert out.numpy().tolist() == [4, 3, 2, 1, 0]


def test_launches_after_an_error_work(device, debug):
    @wp.kernel
    def maybe(a: wp.array(dtype=float), k: int):
        i = wp.tid()
        a[i + k] = 1.0  # here

    a = wp.zeros(4, dtype=float, device=device)
    check_blamed(maybe, 4, [a, 1], device, "'a'")
    wp.launch(maybe, 4, [a, 0], device=device)
    wp.synchronize_device(device)
    assert a.numpy().tolist() == [1.0] * 4


def test_a_derivative_names_the_kernel(device, debug):
    @wp.kernel
    def shifted(values: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = 2.0 * values[i + 3]  # here

    values, out = (wp.zeros(10, dtype=float, device=device, requires_grad=True) for _ in range(2))
    with pytest.raises(errors.WarpError) as caught:
        wp.launch(shifted, 8, [values], [out], device=device, adjoint=True)
        wp.synchronize_device(device)
    message = str(caught.value)
    assert f"kernel '{shifted.key}'" in message and "_adjoint" not in message
    assert "'values.grad'" in message and "test_debug_mode.py" in message
