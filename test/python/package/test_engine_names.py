"""Attributes of kernels, settings and data that engines written for the peer read."""

import copy
import pickle
import typing
from typing import Any

import numpy as np
import pytest

import warp as wp


@wp.kernel
def filled(a: wp.array2d(dtype=Any), n: int, b: wp.array(dtype=wp.vec3)):
    a[0, 0] = a.dtype(n)


def test_parameters_of_kernels():
    found = {one.label: one.type for one in filled.adj.args}
    assert list(found) == ["a", "n", "b"]
    assert wp.types.is_array(found["a"]) and found["a"].dtype is Any and found["a"].ndim == 2
    assert found["n"] is int and found["b"].dtype is wp.vec3
    types = {"a": wp.array(dtype=wp.float64, ndim=found["a"].ndim)}
    a = wp.zeros((1, 1), dtype=wp.float64, device="cpu")
    wp.launch(wp.overload(filled, types), 1, [a, 3, None], device="cpu")
    assert a.numpy()[0, 0] == 3.0


def test_annotations_of_arrays_are_arrays():
    annotation = wp.array(dtype=float, ndim=2)
    annotation.shape = ("*", "nbody")
    assert isinstance(annotation, wp.array) and not isinstance(annotation, wp.indexedarray)
    assert annotation.shape[0] == "*" and annotation == wp.array2d(dtype=float)
    assert not isinstance(wp.indexedarray(dtype=float), wp.array)
    for made in (copy.deepcopy(annotation), pickle.loads(pickle.dumps(annotation))):
        assert made == annotation and made.shape == annotation.shape
    other = pickle.loads(pickle.dumps(wp.indexedarray(dtype=float)))
    assert other == wp.indexedarray(dtype=float)
    with pytest.raises(TypeError, match="argument 'b' expects 'array"):
        wp.launch(filled, 1, [wp.zeros((1, 1), device="cpu"), 1, annotation], device="cpu")


def test_the_default_of_deterministic_is_a_mode():
    assert wp.config.deterministic is wp.DeterministicMode.NOT_GUARANTEED
    assert not wp.config.deterministic


@pytest.mark.parametrize("data", [[], np.zeros(0), np.zeros((0,), np.int32)])
def test_empty_data_has_the_rank_that_is_asked_for(data):
    made = wp.array(data, dtype=int, ndim=2, device="cpu")
    assert made.shape == (0, 0) and made.dtype is wp.int32
    assert wp.array(data, dtype=wp.vec3, ndim=3, requires_grad=True).grad.ndim == 3
    with pytest.raises(ValueError, match="expects 2 dimensions"):
        wp.array([1, 2], dtype=int, ndim=2)


# Newton fills gaps among numbers of Python with defaults of this package.
@pytest.mark.parametrize(
    ("dtype", "data"),
    [
        (int, [3, wp.int32(2), np.int64(-1)]),
        (float, [[wp.float64(0.5), 1], [2.25, wp.uint8(7)]]),
        (bool, [wp.bool(True), False]),
        (wp.uint64, [2**63, wp.uint64(2**64 - 1)]),
    ],
)
def test_numbers_of_both_kinds_beside_each_other(dtype, data):
    plain = [[getattr(one, "value", one) for one in np.ravel(row)] for row in data]
    made = wp.array(data, dtype=dtype, device="cpu").numpy()
    assert made.ravel().tolist() == [one for row in plain for one in row]


@pytest.mark.parametrize(
    "data", [[3, None], [wp.int32(3), "4"], [1, wp.vec2()], [1, [wp.int32(2)]]]
)
def test_other_things_beside_numbers(data):
    with pytest.raises((TypeError, ValueError), match=r"expects numbers|cannot make an array"):
        wp.array(data, dtype=int, device="cpu")


class Vector:
    """Has its components by number alone, as vectors of USD have."""

    def __len__(self):
        return 3

    def __getitem__(self, index):
        return (1.0, 2.0, 3.0)[index]


def test_vectors_of_other_packages():
    assert wp.vec3(Vector()) == wp.vec3(1.0, 2.0, 3.0)
    made = wp.transform(Vector(), wp.quat_identity())
    assert made == wp.transform(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0)
    assert wp.vec3(wp.array([1.0, 2.0, 3.0], device="cpu")) == wp.vec3(1.0, 2.0, 3.0)


@wp.kernel
def keep_nothing(out: wp.array(dtype=int)):
    kept = wp.vector(length=wp.static(0), dtype=wp.uint32)
    count = int(0)
    if count < wp.static(0):
        kept[count] = wp.uint32(1)
    total = int(0)
    for i in range(count):
        total += int(kept[i])
    out[0] = total


def test_vectors_without_components():
    out = wp.ones(1, dtype=int, device="cpu")
    wp.launch(keep_nothing, 1, [out], device="cpu")
    assert out.numpy()[0] == 0


@pytest.mark.parametrize(
    "kind", [wp.array[bool], wp.array2d[wp.vec3], wp.array(dtype=int), wp.indexedarray[float]]
)
def test_annotations_of_arrays_or_none(kind):
    assert (kind | None) == typing.Optional[kind]  # noqa: UP045
    assert typing.get_args(None | kind) == (type(None), kind)
    assert typing.get_args(kind | int) == (kind, int)

    def function(a: wp.array[int] | None = None, b: None | wp.array2d[float] = None):
        return a, b

    assert function() == (None, None)
