"""CPU launches of many threads that take slots of a counter run on all cores, in any order."""

import os
import subprocess
import sys

import numpy as np
import pytest

import warp as wp
from warp._src.kernels import native_code

CPU = "cpu"
MOST = 1 << 17
REASON = "who comes first shows, and is who has the lower index"


@wp.kernel
def take(used: wp.array[int], holder: wp.array[int], work: int):
    i = wp.tid()
    x = float(i)
    for _ in range(work):
        x = wp.sin(x)
    if x < 2.0:
        holder[wp.atomic_add(used, 0, 1)] = i


@wp.kernel
def take_of_grid(used: wp.array[int], holder: wp.array[int]):
    i, j = wp.tid()
    holder[wp.atomic_add(used, 0, 1)] = 256 * i + j


@wp.kernel
def exchange(last: wp.array[int]):
    wp.atomic_exch(last, 0, wp.tid())


@wp.kernel
def lock(word: wp.array[int], total: wp.array[int]):
    while wp.atomic_cas(word, 0, 0, 1) == 1:
        pass
    total[0] = total[0] + 1
    wp.atomic_exch(word, 0, 0)


@wp.func_native("return atomicAdd(&used.data[0], 1);")
def next_slot(used: wp.array(dtype=int)) -> int: ...


@wp.kernel(enable_backward=False)
def take_natively(used: wp.array[int], holder: wp.array[int]):
    i = wp.tid()
    holder[next_slot(used)] = i


@wp.kernel
def histogram(bin_of: wp.array[int], count: wp.array[int]):
    wp.atomic_add(count, bin_of[wp.tid()], 1)


@wp.kernel
def scale(x: wp.array[float]):
    i = wp.tid()
    x[i] = 2.0 * x[i]


def fresh(kernel, **options):
    """The same kernel without code, with options of its own."""
    fresh.made += 1
    return wp.Kernel(kernel.func, f"{kernel.key}_{fresh.made}", options=options)


fresh.made = 0


def zeros(n):
    return wp.zeros(n, dtype=int, device=CPU)


def keeps_order(kernel, dim):
    """True if one core runs a launch of that size because of its slots."""
    choices = kernel.schedule(CPU, dim=dim)[0].choices
    return REASON in [str(one.reason) for one in choices if one.what == "updates"]


def holders(kernel, n):
    used, holder = zeros(1), zeros(n)
    wp.launch(kernel, n, [used, holder, 3], device=CPU)
    assert used.numpy()[0] == n
    return holder.numpy()


def kinds(kernel):
    """The kinds of launches that have code."""
    return [str(one).splitlines()[0] for one in kernel.schedule(CPU)]


@pytest.mark.parametrize("kernel", [take, exchange, lock, take_natively], ids=lambda k: k.key)
def test_many_threads_use_all_cores(kernel):
    if kernel is take_natively and not native_code.compiler():
        pytest.skip("no Clang")
    assert keeps_order(kernel, 1) and keeps_order(kernel, MOST)
    assert not keeps_order(kernel, MOST + 1) and not keeps_order(kernel, 1 << 24)


def test_threads_of_all_dimensions_count():
    assert keeps_order(take_of_grid, (512, 256)) and not keeps_order(take_of_grid, (513, 256))
    kernel = fresh(take_of_grid)
    for rows in (512, 513):
        holder = zeros(256 * rows)
        wp.launch(kernel, (rows, 256), [zeros(1), holder], device=CPU)
        found = holder.numpy() if rows == 512 else np.sort(holder.numpy())
        assert np.array_equal(found, np.arange(256 * rows))


def test_code_for_either():
    kernel = fresh(take)
    assert np.array_equal(holders(kernel, 1000), np.arange(1000))
    assert np.array_equal(np.sort(holders(kernel, MOST + 1)), np.arange(MOST + 1))
    assert np.array_equal(holders(kernel, MOST), np.arange(MOST))
    assert len(kinds(kernel)) == 2
    small, large = ([str(one.reason) for one in s.choices] for s in kernel.schedule(CPU))
    assert REASON in small and REASON not in large
    assert "many threads" in kinds(kernel)[1] and "many threads" not in kinds(kernel)[0]


@pytest.mark.parametrize("n", [MOST, MOST + 1])
def test_a_lock_works_on_all_cores(n):
    total = zeros(1)
    wp.launch(lock, n, [zeros(1), total], device=CPU)
    assert total.numpy()[0] == n


@pytest.mark.parametrize("kernel", [histogram, scale], ids=lambda k: k.key)
def test_other_kernels_are_compiled_once(kernel):
    kernel = fresh(kernel)
    n = 3 * MOST
    arrays = [wp.zeros(n, dtype=int if i else a.type.dtype, device=CPU)
              for i, a in enumerate(kernel.adj.args)]  # fmt: skip
    for size in (1000, n, MOST, MOST + 1):
        wp.launch(kernel, size, arrays, device=CPU)
        # Where many cores add to few elements, another version makes no copies.
        made = {kind.removesuffix(", arrays may overlap") for kind in kinds(kernel)}
        assert len(made) == 1


@pytest.mark.parametrize(
    "value, in_order, not_in_order",
    [
        (True, [1, MOST + 1, 1 << 30], []),
        (False, [], [2, 1000, MOST]),
        (0, [], [2, 1000, MOST]),
        (1000, [1, 1000], [1001, MOST]),
        (1 << 20, [MOST + 1, 1 << 20], [(1 << 20) + 1]),
        (1 << 70, [1 << 30], []),
    ],
)
def test_values_of_the_setting(value, in_order, not_in_order):
    def check(kernel):
        assert [keeps_order(kernel, n) for n in in_order + not_in_order] == [
            *(True for _ in in_order),
            *(False for _ in not_in_order),
        ]

    check(fresh(take, ordered_slots=value))
    before = wp.config.ordered_slots
    try:
        wp.config.ordered_slots = value
        check(take)
    finally:
        wp.config.ordered_slots = before
    assert keeps_order(take, MOST) and not keeps_order(take, MOST + 1)
    module = wp.get_module(__name__)
    wp.set_module_options({"ordered_slots": value}, module)
    try:
        check(take)
    finally:
        del module.options["ordered_slots"]
        module.mark_modified()


def test_always_and_up_to_a_number():
    n = 400_000
    assert np.array_equal(holders(fresh(take, ordered_slots=True), n), np.arange(n))
    assert np.array_equal(holders(fresh(take, ordered_slots=n), n), np.arange(n))
    found = holders(fresh(take, ordered_slots=n - 1), n)
    assert np.array_equal(np.sort(found), np.arange(n))


def test_deterministic_launches_of_any_size_keep_the_order():
    kernel = fresh(take, deterministic=True)
    for n in (1000, 3 * MOST):
        assert np.array_equal(holders(kernel, n), np.arange(n))
    assert len(kinds(kernel)) == 1


def test_a_graph_has_code_for_its_launches():
    used, few, many = zeros(2), zeros(MOST), zeros(MOST + 1)
    with wp.ScopedCapture(CPU) as capture:
        used.zero_()
        wp.launch(take, MOST, [used[:1], few, 2], device=CPU)
        wp.launch(take, MOST + 1, [used[1:], many, 2], device=CPU)
    for _ in range(3):
        wp.capture_launch(capture.graph)
        assert np.array_equal(few.numpy(), np.arange(MOST))
        assert np.array_equal(np.sort(many.numpy()), np.arange(MOST + 1))


def test_a_recorded_launch_changes_its_size():
    used, holder = zeros(1), zeros(MOST + 1)
    launch = wp.launch(fresh(take), 1, [used, holder, 2], device=CPU, record_cmd=True)
    for n in (MOST, MOST + 1, MOST):
        used.zero_()
        launch.set_dim(n)
        launch.launch()
        found = holder.numpy()[:n]
        assert np.array_equal(found if n == MOST else np.sort(found), np.arange(n))


@pytest.mark.parametrize("value, error", [(-1, ValueError), ("many", TypeError), (1.5, TypeError)])
def test_bad_values(value, error):
    with pytest.raises(error, match="ordered_slots expects"):
        wp.config.ordered_slots = value
    with pytest.raises(error, match="ordered_slots expects"):
        wp.set_module_options({"ordered_slots": value})
    with pytest.raises(error, match="ordered_slots expects"):
        wp.kernel(scale.func, module_options={"ordered_slots": value})


SAVED = """
import warp as wp
import numpy as np

@wp.kernel
def take(used: wp.array(dtype=int), holder: wp.array(dtype=int)):
    holder[wp.atomic_add(used, 0, 1)] = wp.tid()

def run(n):
    used, holder = wp.zeros(1, dtype=int, device="cpu"), wp.zeros(n, dtype=int, device="cpu")
    wp.launch(take, n, [used, holder], device="cpu")
    return holder.numpy()
"""

USE = """
import sys
sys.path.insert(0, sys.argv[1])
import saved_slots as m
import numpy as np
import warp as wp
wp.config.cache_kernels = False
wp.load_aot_module(m, device="cpu", module_dir=sys.argv[1], strip_hash=True)
for n in (131072, 131073):
    found = m.run(n)
    order = np.arange(n)
    print(np.array_equal(found, order) if n == 131072 else np.array_equal(np.sort(found), order))
print(len(m.take.schedule("cpu")), m.take.native.compile_times().get("compile"))
"""


def test_saved_code_is_chosen_by_size(tmp_path, monkeypatch):
    (tmp_path / "saved_slots.py").write_text(SAVED)
    monkeypatch.syspath_prepend(tmp_path)
    import saved_slots

    wp.compile_aot_module(saved_slots, device=CPU, module_dir=tmp_path, strip_hash=True)
    path = os.pathsep.join(entry for entry in sys.path if entry)
    result = subprocess.run(
        [sys.executable, "-c", USE, str(tmp_path)],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert result.stderr == ""
    assert result.stdout.splitlines() == ["True", "True", "2 None"]
