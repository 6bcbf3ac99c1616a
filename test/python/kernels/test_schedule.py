"""`Kernel.schedule` says what was decided about launches."""

import numpy as np
import pytest

import warp as wp


@wp.kernel
def scale(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 2.0 * x[i]


@wp.kernel
def total(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    wp.atomic_add(y, 0, x[i])


@wp.kernel
def pairs(x: wp.array(dtype=float), y: wp.array(dtype=float), n: int):
    i = wp.tid()
    s = float(0.0)
    for j in range(n):
        s += wp.abs(x[j] - x[i])
    y[i] = s


@wp.kernel
def turn(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i, j = wp.tid()
    y[j, i] = x[i, j]


def only(schedules):
    (one,) = schedules
    return one


def test_sizes_of_launches_decide():
    """The threads of a card that is not there; more of them share more."""
    assert only(scale.schedule(arch=90, dim=1000))["coarsening"] == "1"
    assert only(scale.schedule(arch=90, dim=1 << 24))["coarsening"] == "4"
    assert only(pairs.schedule(arch=90, dim=1 << 18))["coarsening"] == "2"
    few = only(pairs.schedule(arch=90, dim=1000))
    assert few["coarsening"] == "1" and "few threads" in few.launch
    assert only(turn.schedule(arch=90, dim=(512, 512)))["transpose_tile"] == "32 x 32"
    assert "transpose_tile" not in only(turn.schedule(arch=90, dim=(100000, 3)))


def test_facts():
    """The facts of docs/launch.md, as the runtime has them."""
    facts = only(scale.schedule(arch=90, dim=1 << 24)).facts
    assert facts["coarsening"] == 4 and facts["reverse_order"] is True
    few = only(pairs.schedule(arch=90, dim=1000)).facts
    assert few["coarsening"] == 1 and few["transpose_tile"] == 0
    assert only(turn.schedule(arch=90, dim=(512, 512))).facts["transpose_tile"] == 32
    cpu = only(scale.schedule("cpu", dim=1000)).facts
    assert cpu["lanes"] > 1 and cpu["cost"] > 0 and not cpu["atomics"]


def test_order_of_blocks():
    """Launches that stream may begin at either end; sums of floats are made in one order."""
    large = only(scale.schedule(arch=90, dim=1 << 24))
    assert large["reverse_order"] == "every other launch"
    sums = only(total.schedule(arch=90, dim=1 << 24))
    assert "reverse_order" not in {choice.what for choice in sums.choices}


def test_reasons_name_lines():
    found = only(pairs.schedule(arch=90, dim=1 << 18))
    first = pairs.func.__code__.co_firstlineno
    tiles = next(c for c in found.choices if c.what == "loop")
    assert tiles.line == first + 4, "the line of the loop"
    text = str(found)
    assert f"(line {first + 4})" in text and tiles.reason in text
    assert int(found["ptx"]) > 20


def test_lanes_and_sums_of_a_processor():
    found = only(scale.schedule("cpu", dim=1000))
    assert found.launch.startswith("cpu, 1 dimension")
    assert "load" not in found or found["load"] == "vectors"
    assert only(total.schedule("cpu", dim=1000))["update"] == "one per group"


def test_launches_made_are_listed(device):
    kernel = wp.Kernel(total.func, key="listed")
    x, y = (wp.zeros(64, dtype=float, device=device) for _ in range(2))
    wp.launch(kernel, 64, [x, y], device=device)
    wp.launch(kernel, 64, [x, x], device=device)
    wp.launch(
        kernel, 32, [wp.array(np.zeros(64), dtype=float, device=device)[::2], y], device=device
    )
    kinds = [one.launch for one in kernel.schedule(device)]
    assert len(kinds) >= 2 and all(device in kind for kind in kinds)
    assert str(kernel.schedule(device)).count("listed: ") == len(kinds)


def test_wrong_questions():
    with pytest.raises(ValueError, match="architecture 12"):
        scale.schedule(arch=12)
    with pytest.raises(KeyError):
        only(scale.schedule("cpu"))["squares"]


@wp.func
def height(balls: wp.array(dtype=float), x: float):
    top = float(0.0)
    for k in range(balls.shape[0]):
        top = wp.max(top, balls[k] - wp.abs(x - float(k)))
    return top


@wp.kernel
def march(balls: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    x = 0.01 * float(i)
    for _ in range(100):
        if height(balls, x) > 0.5:
            break
        x += 0.01
    y[i] = x


def test_functions_that_loops_call_may_have_lanes():
    """The end of the loop is loaded in a function, from an array that nobody writes."""
    balls = wp.array([0.2, 0.9, 0.1, 0.8], dtype=float, device="cpu")
    y = wp.zeros(256, dtype=float, device="cpu")
    wp.launch(march, 256, [balls], [y], device="cpu")
    assert int(only(march.schedule("cpu"))["lanes"]) > 1
    x = 0.01 * np.arange(256)
    given, places = balls.numpy()[:, None], np.arange(4)[:, None]
    for _ in range(100):
        top = np.maximum((given - np.abs(x - places)).max(0), 0.0)
        x = np.where(top > 0.5, x, x + 0.01)
    assert np.abs(y.numpy() - x).max() < 0.011


@wp.kernel
def forces(x: wp.array(dtype=float), y: wp.array(dtype=float), n: int):
    i = wp.tid()
    s = float(0.0)
    for j in range(n):
        s += wp.abs(x[j] - x[i])
    y[i] = s


forces.options["fast_math"] = True


@wp.kernel
def accumulate(x: wp.array(dtype=float), y: wp.array(dtype=float), n: int):
    i = wp.tid()
    for j in range(n):
        wp.atomic_add(y, j, x[i] * x[j])


@wp.kernel
def product(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), c: wp.array2d(dtype=float)):
    i, j = wp.tid()
    s = wp.tile_zeros(shape=(64, 64), dtype=float)
    for k in range(16):
        x = wp.tile_load(a, shape=(64, 16), offset=(i * 64, k * 16))
        y = wp.tile_load(b, shape=(16, 64), offset=(k * 16, j * 64))
        wp.tile_matmul(x, y, s)
    wp.tile_store(c, s, offset=(i * 64, j * 64))


SCHEDULES = {
    "coarsen_threads": (scale, 1 << 24, "coarsening", "more loads of a thread are in flight"),
    "coarsen_reductions": (total, 1 << 24, "coarsening", "one block reduction for all indices"),
    "unroll_and_jam": (pairs, 1 << 18, "coarsening", "register tiling of a shared loop"),
    "split_reduction": (forces, 1 << 12, "split_reduction", "the warps of a block split"),
    "stage_transposes": (turn, (512, 512), "transpose_tile", "through shared memory (coalesced)"),
    "reverse_order": (scale, 1 << 24, "reverse_order", "alternates for L2 reuse"),
    "ring_reduction": (accumulate, 1 << 18, "loop", "lanes are skewed over iterations"),
    "stage_shared_loads": (pairs, 1 << 18, "loop", "uniform loads staged through shared memory"),
    "coarsen_blocks": (product, (64, 64, 256), "block_coarsening", "read less shared memory"),
    "map_to_grid": (scale, 1000, "coarsening", "the launch is not large"),
}


@pytest.mark.parametrize("name", SCHEDULES)
def test_each_schedule_describes_itself(name):
    kernel, dim, what, reason = SCHEDULES[name]
    choices = only(kernel.schedule(arch=90, dim=dim)).choices
    assert any(c.what == what and reason in c.reason for c in choices), choices
