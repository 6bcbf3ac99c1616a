"""Arrays at Python scope: elements, iteration, numbers, formats, copies, matplotlib."""

import copy

import numpy as np
import pytest

import warp as wp


def test_elements_are_values(device):
    a = wp.array([[1.5, 2.5], [3.5, 4.5]], dtype=float, device=device)
    assert a[1, 0] == 3.5 and isinstance(a[1, 0], float)
    assert a[-1][-1] == 4.5
    assert wp.array([7, 8], dtype=wp.int64, device=device)[1] == 8
    v = wp.array([[1, 2, 3]], dtype=wp.vec3, device=device)[0]
    assert isinstance(v, wp.vec3) and v == wp.vec3(1.0, 2.0, 3.0)
    v[0] = 9.0
    strided = wp.array(np.arange(10), dtype=wp.int32, device=device)[1::3]
    assert [strided[k] for k in range(3)] == [1, 4, 7]
    with pytest.raises(IndexError):
        a[2, 0]


def test_one_dimension_is_iterated_over(device):
    assert list(wp.array([1.5, 2.5], dtype=float, device=device)) == [1.5, 2.5]
    assert sum(wp.array([1, 2, 3], dtype=int, device=device)) == 6
    rows = list(wp.zeros((2, 3), dtype=float, device=device))
    assert [row.shape for row in rows] == [(3,), (3,)]


def test_new_dimensions(device):
    a = wp.array(np.arange(6).reshape(2, 3), dtype=float, device=device)
    for key in ((slice(None), None), (None, 1), (1, None), (slice(None), None, slice(1, 3)), None):
        np.testing.assert_array_equal(a[key].numpy(), a.numpy()[key])
    b = wp.array([1.0, 2.0], dtype=float, device=device)
    column = b[:, None]
    column[1, 0] = 5.0
    assert b[1] == 5.0
    with pytest.raises(IndexError, match=r"`None` or `\.\.\.`"):
        a[..., None]


def test_one_number_is_a_number(device):
    one = wp.array([2.25], dtype=float, device=device)
    assert float(one) == 2.25 and int(one) == 2
    assert f"{one:.1f}" == "2.2"
    assert f"{one}" == "[2.25]"
    with pytest.raises(TypeError, match=r"one number for float\(\), but got shape \(2,\)"):
        float(wp.zeros(2, dtype=float, device=device))
    with pytest.raises(TypeError, match=r"one number for the format '\.2f'"):
        f"{wp.zeros(1, dtype=wp.vec3, device=device):.2f}"


def test_composites_have_formats():
    assert f"{wp.vec3(1.0, 2.0, 3.25):.1f}" == "[1.0, 2.0, 3.2]"
    assert f"{wp.vec2i(3, 4)}" == str(wp.vec2i(3, 4))
    with pytest.raises(ValueError):
        f"{wp.vec3():y}"


def test_parts_are_filled(device):
    a = wp.zeros(6, dtype=float, device=device)
    a[:4].fill(1.25)
    a[1] = 3.0
    assert a.list() == [1.25, 3.0, 1.25, 1.25, 0.0, 0.0]


def test_copies_have_memory_of_their_own(device):
    a = wp.array([1.0, 2.0], dtype=float, device=device, requires_grad=True)
    for duplicate in (copy.copy(a), copy.deepcopy(a)):
        duplicate[0] = 7.0
        assert a[0] == 1.0 and duplicate.device == a.device and duplicate.requires_grad


def test_matplotlib_draws_arrays(device):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot

    y = wp.array([1.0, 4.0, 9.0], dtype=float, device=device)
    figure, axes = pyplot.subplots()
    (line,) = axes.plot(y)
    np.testing.assert_array_equal(line.get_xydata(), [[0, 1], [1, 4], [2, 9]])
    (line,) = axes.plot(y, y)
    np.testing.assert_array_equal(line.get_xydata(), [[1, 1], [4, 4], [9, 9]])
    counts, *_ = axes.hist(y, bins=[0, 2, 10])
    assert counts.tolist() == [1, 2]
    axes.scatter(y, y)
    pyplot.close(figure)
