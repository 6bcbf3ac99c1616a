"""Kernels with a module of their own: equal definitions give one kernel, others never do."""

import importlib.util
import sys

import numpy as np
import pytest

import warp as wp

FACTOR = 3.0


class Settings:
    """Read in kernels by attribute."""

    factor = 2.0


def scaled(factor):
    @wp.kernel(module="unique")
    def scale(x: wp.array(dtype=float)):
        x[wp.tid()] = x[wp.tid()] * factor

    return scale


def by_setting():
    @wp.kernel(module="unique")
    def scale(x: wp.array(dtype=float)):
        x[wp.tid()] = x[wp.tid()] * wp.static(Settings.factor * FACTOR)

    return scale


def by_list(values):
    @wp.kernel(module="unique")
    def store(x: wp.array(dtype=float)):
        for i in range(wp.static(len(values))):
            x[i] = wp.static(values[i])

    return store


def calling(function):
    @wp.kernel(module="unique")
    def apply(x: wp.array(dtype=float)):
        x[wp.tid()] = function(x[wp.tid()])

    return apply


def added(number):
    @wp.func
    def add(x: float):
        return x + number

    return add


def ran(kernel, n=2):
    x = wp.ones(n, dtype=float, device="cpu")
    wp.launch(kernel, n, inputs=[x], device="cpu")
    return x.numpy()


def test_captured_numbers():
    first, second, again = scaled(2.0), scaled(5.0), scaled(2.0)
    assert first is again
    assert first is not second
    assert first.module.name != second.module.name
    np.testing.assert_array_equal(ran(second), [5.0, 5.0])
    np.testing.assert_array_equal(ran(again), [2.0, 2.0])
    assert scaled(2) is not first  # an int is another type


def test_captured_attributes_and_globals(monkeypatch):
    first = by_setting()
    np.testing.assert_array_equal(ran(first), [6.0, 6.0])
    assert by_setting() is first
    monkeypatch.setattr(Settings, "factor", 4.0)
    second = by_setting()
    assert second is not first
    np.testing.assert_array_equal(ran(second), [12.0, 12.0])
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 0.5)
    np.testing.assert_array_equal(ran(by_setting()), [2.0, 2.0])


def test_a_capture_that_changes_before_the_first_launch():
    values = [1.0, 2.0]
    first = by_list(values)
    values[0] = 7.0
    np.testing.assert_array_equal(ran(first), [7.0, 2.0])
    other = by_list([1.0, 2.0])
    assert other is not first
    np.testing.assert_array_equal(ran(other), [1.0, 2.0])


def test_a_global_named_like_an_attribute_that_is_defined_before_the_first_launch(monkeypatch):
    kernel = scaled(2.0)
    # The kernel says `wp.tid`: it is not this one that it means.
    monkeypatch.setattr(sys.modules[__name__], "tid", object(), raising=False)
    np.testing.assert_array_equal(ran(kernel), [2.0, 2.0])


def test_captured_functions():
    first = calling(added(1.0))
    assert calling(added(1.0)) is first
    second = calling(added(2.0))
    assert second is not first
    np.testing.assert_array_equal(ran(second), [3.0, 3.0])
    np.testing.assert_array_equal(ran(first), [2.0, 2.0])


def test_what_may_change_unseen_is_never_shared():
    def make(held):
        @wp.kernel(module="unique")
        def store(x: wp.array(dtype=float)):
            x[wp.tid()] = wp.static(held.value)

        return store

    held = Settings()
    held.value = 1.0
    assert make(held) is not make(held)


def test_options_tell_kernels_apart():
    def make(options=None, **own):
        @wp.kernel(module="unique", module_options=options, **own)
        def scale(x: wp.array(dtype=float)):
            x[wp.tid()] = x[wp.tid()] * 2.0

        return scale

    made = [make(), make({"fast_math": True}), make(launch_bounds=64), make(grid_stride=False)]
    assert len(set(made)) == len({kernel.module.name for kernel in made}) == 4
    assert make({"fast_math": True}) is made[1]
    assert made[1].module.options["fast_math"] is True
    assert made[0].module.options["fast_math"] is False


def test_dropped_kernels_are_freed():
    made = scaled(123.0).module.name
    assert scaled(123.0).module.name != made


@pytest.mark.parametrize(
    ("options", "kind"),
    [
        ("fast_math", TypeError),
        ({"fast_mth": True}, ValueError),
        ({"deterministic_max_records": True}, TypeError),
        ({"deterministic_max_records": -1}, ValueError),
    ],
)
def test_wrong_options(options, kind):
    with pytest.raises(kind):
        wp.kernel(module="unique", module_options=options)(lambda: None)


def test_counts_may_be_numbers_of_numpy():
    kernel = wp.kernel(module="unique", module_options={"deterministic_max_records": np.int64(20)})
    assert kernel(lambda: None).module.options["deterministic_max_records"] == 20


def test_the_file_may_be_gone_at_the_first_launch(tmp_path):
    file = tmp_path / "written.py"
    body = "import warp as wp\n@wp.func\ndef three():\n    return 3.0\n"
    body += "@wp.kernel\ndef store(x: wp.array(dtype=float)):\n    x[wp.tid()] = three()\n"
    file.write_text(body)
    spec = importlib.util.spec_from_file_location("written", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    file.unlink()
    np.testing.assert_array_equal(ran(module.store), [3.0, 3.0])
