"""Nothing that programs store on an array frees the memory that it uses."""

import gc

import numpy as np
import pytest

import warp as wp

MADE = {
    "allocated": lambda: wp.full(1000, 3.0, dtype=float, device="cpu"),
    "view": lambda: wp.full(2000, 3.0, dtype=float, device="cpu")[1000:],
    "reshaped": lambda: wp.full((20, 50), 3.0, dtype=float, device="cpu").flatten(),
    "numpy": lambda: wp.array(np.full(1000, 3.0, np.float32), copy=False, device="cpu"),
    "dlpack": lambda: wp.from_dlpack(np.full(1000, 3.0, np.float32)),
    "gradient": lambda: gradient(),
    "indexed": lambda: wp.indexedarray(
        wp.full(1000, 3.0, dtype=float, device="cpu"),
        [wp.array(np.arange(1000), dtype=int, device="cpu")],
    ),
}


def gradient():
    a = wp.zeros(1000, dtype=float, device="cpu", requires_grad=True)
    a.grad.fill_(3.0)
    return a.grad


@pytest.mark.parametrize("made", MADE)
@pytest.mark.parametrize("name", ["owner", "base", "memory", "source", "name", "deleter", "_ref"])
def test_any_attribute_may_be_stored(made, name):
    a = MADE[made]()
    for value in ("simulation A", None, 1):
        setattr(a, name, value)
        assert getattr(a, name) == value
    gc.collect()
    others = [wp.full(1000, 9.0, dtype=float, device="cpu") for _ in range(50)]
    assert (a.numpy() == 3).all()
    a.fill_(7.0)
    assert all((one.numpy() == 9).all() for one in others)


@pytest.mark.parametrize(
    "name", ["_owner", "read_only", "shape", "strides", "size", "device", "dtype"]
)
def test_what_memory_depends_on_cannot_be_replaced(name):
    a = MADE["allocated"]()
    for change in (lambda: setattr(a, name, None), lambda: delattr(a, name)):
        with pytest.raises((AttributeError, TypeError)):
            change()
    assert (a.numpy() == 3).all()
