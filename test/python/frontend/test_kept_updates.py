"""Functions that stay although they update elements, print, or pass arrays on."""

import re

import numpy as np
import pytest

import warp as wp

BUDGET = {"inline_budget": 64}


@wp.func
def ninefold(x: float):
    """Makes its caller longer than what is always copied."""
    m = wp.identity(n=4, dtype=float) * x
    m = m + 0.5 * m
    m = m - 0.25 * m
    m = 2.0 * m
    return wp.trace(m)


@wp.func
def record(x: float, limit: int, count: wp.array(dtype=int), flags: wp.array(dtype=int),
           found: wp.array(dtype=float)):  # fmt: skip
    """Takes a slot of a list, or says that there is none."""
    value = ninefold(x)
    slot = wp.atomic_add(count, 0, 1)
    if slot >= limit:
        wp.printf("no slot for %f\n", value)
        wp.atomic_or(flags, 0, 4)
        return
    found[slot] = value


@wp.kernel(module="unique", module_options=BUDGET)
def recording(x: wp.array(dtype=float), limit: int, count: wp.array(dtype=int),
              flags: wp.array(dtype=int), found: wp.array(dtype=float)):  # fmt: skip
    i = wp.tid()
    record(x[i], limit, count, flags, found)
    if i % 2 == 0:
        record(x[i] + 1.0, limit, count, flags, found)
    record(x[i] + 2.0, limit, count, flags, found)


def test_each_update_is_made_once(device):
    """Slots are taken once each, whoever gets them; one launch has too few."""
    size = 200
    points = np.linspace(-1.0, 1.0, size).astype(np.float32)
    arguments = [points, points[::2] + 1.0, points + 2.0]
    values = np.sort(np.concatenate(arguments).astype(np.float64))
    wanted = 9.0 * values
    for limit in (len(values), len(values) - 1):
        count, flags = (wp.zeros(1, dtype=int, device=device) for _ in range(2))
        found = wp.zeros(limit, dtype=float, device=device)
        x = wp.array(points, dtype=float, device=device)
        wp.launch(recording, size, [x, limit, count, flags, found], device=device)
        assert count.numpy()[0] == len(values)
        assert flags.numpy()[0] == (4 if limit < len(values) else 0)
        ordered = np.sort(found.numpy())
        if limit == len(values):
            np.testing.assert_allclose(ordered, wanted, atol=2e-5)
        else:
            assert np.all(np.min(np.abs(ordered[:, None] - wanted), axis=1) < 2e-5)


def test_updates_stay_in_functions_on_gpus():
    """A CPU plans the updates of a kernel as a whole, so there the function is inlined."""
    text = recording.ir("ptx", arch=90)
    functions = [f for f in re.split(r"\.func|\.entry", text) if "\n{" in f]
    body = next(f for f in functions if f.lstrip().startswith("record("))
    entry = next(f for f in functions if f.lstrip().startswith("recording("))
    assert "vprintf" in body and re.search(r"\batom\.", body)
    assert "vprintf" not in entry and not re.search(r"\b(atom|red)\.", entry)
    assert "@record(" not in recording.ir("llvm")


@pytest.mark.parametrize("option", ["mode", "deterministic"])
def test_updates_of_checked_launches_are_in_the_kernel(option):
    """Debug launches check each access, deterministic ones plan all updates of the kernel."""
    options = {**BUDGET, option: "debug" if option == "mode" else True}
    kernel = wp.kernel(recording.func, module="unique", module_options=options)
    assert "record(" not in kernel.ir("ptx", arch=90)


@wp.func
def add_up(x: float, total: wp.array(dtype=float)):
    wp.atomic_add(total, 0, ninefold(x))


@wp.kernel(module="unique", module_options=BUDGET)
def adding(x: wp.array(dtype=float), total: wp.array(dtype=float)):
    i = wp.tid()
    add_up(x[i], total)
    add_up(x[i] + 1.0, total)


def test_threads_add_up_together(device):
    """Sums of floats are in the kernel, where a warp makes one update of them."""
    x = wp.full(96, 0.5, dtype=float, device=device)
    total = wp.zeros(1, dtype=float, device=device)
    wp.launch(adding, 96, [x, total], device=device)
    assert total.numpy()[0] == 96 * 9 * 2.0
    text = adding.ir("ptx", arch=90)
    assert "add_up(" not in text and "shfl.sync" in text


@wp.struct
class Part:
    """A piece of an array."""

    values: wp.array(dtype=float)
    first: int


@wp.func
def part_of(values: wp.array(dtype=float), first: int):
    part = Part()
    part.values = values
    part.first = first
    return part


@wp.func
def weigh(values: wp.array(dtype=float), first: int, x: float):
    """Has a function that returns an array become part of it."""
    part = part_of(values, first)
    return ninefold(x) * (part.values[part.first] + part.values[part.first + 1])


@wp.kernel(module="unique", module_options=BUDGET)
def weighing(values: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = weigh(values, i, 0.5) - weigh(values, i + 1, 1.5)


def test_arrays_from_inlined_functions(device):
    """A function stays whose callee, which is inlined, returns an array."""
    rows = np.random.default_rng(3).uniform(-1.0, 1.0, 102).astype(np.float32)
    y = wp.zeros(100, dtype=float, device=device)
    wp.launch(weighing, 100, [wp.array(rows, dtype=float, device=device), y], device=device)

    def weigh(first, x):
        return 9.0 * x * (rows[first : first + 100] + rows[first + 1 : first + 101])

    np.testing.assert_allclose(y.numpy(), weigh(0, 0.5) - weigh(1, 1.5), atol=2e-5)
    text = weighing.ir("ptx", arch=90)
    assert re.search(r"\bweigh\(", text) and "part_of(" not in text
