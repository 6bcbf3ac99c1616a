"""Classes that programs derive from `wp.array`, with arguments that only they know."""

import numpy as np
import pytest

import warp as wp
import warp.autograd


class Tagged(wp.array):
    made = 0

    def __init__(self, *args, tag, **kwargs):
        Tagged.made += 1
        self.tag = tag
        super().__init__(*args, **kwargs)


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def double(x: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 2.0 * x[i]


def _tagged(values):
    return Tagged(values, dtype=float, tag="mine", requires_grad=True)


def test_jacobians_make_no_objects_of_a_derived_class():
    x, y = _tagged([1.0, 2.0, 3.0]), _tagged([0.0] * 3)
    before = Tagged.made
    found = warp.autograd.jacobian(square, 3, [x], [y])[0, 0].numpy()
    np.testing.assert_allclose(found, np.diag([2.0, 4.0, 6.0]))
    assert wp.autograd.gradcheck(square, 3, [x], [y], show_summary=False)
    assert Tagged.made == before


def test_tapes_keep_what_is_overwritten_of_a_derived_class():
    x, y = _tagged([1.0, 2.0, 3.0]), _tagged([0.0] * 3)
    before = Tagged.made
    with wp.Tape() as tape:
        wp.launch(square, 3, [x, y])
        wp.launch(double, 3, [x])
    tape.backward(grads={y: wp.ones(3)})
    # The cotangent of `x` as it was: 2 x.
    np.testing.assert_allclose(x.grad.numpy(), [2.0, 4.0, 6.0])
    assert Tagged.made == before


def test_other_element_types_are_made_of_a_derived_class():
    assert wp.array(_tagged([1.0, 2.5]), dtype=wp.float64).numpy().tolist() == [1.0, 2.5]


class OfRank(Tagged):
    """Describes itself with a number of dimensions that a program chooses."""

    rank = 1

    def __ctype__(self):
        descriptor = type(super().__ctype__()).from_buffer_copy(super().__ctype__())
        descriptor.ndim = self.rank
        return descriptor


@wp.struct
class Held:
    values: wp.array(dtype=float)


def test_fields_refuse_arrays_whose_descriptor_has_another_rank():
    held, array = Held(), OfRank([1.0, 2.0], dtype=float, tag="mine", device="cpu")
    held.values = array
    assert held.values is array
    array.rank = 2
    with pytest.raises(TypeError, match="Struct field 'values'.*descriptor has 2 dimensions"):
        held.values = array


class Redirected(wp.array):
    """An array whose launches get the memory of `other`."""

    def __ctype__(self):
        record = super().__ctype__()
        other = type(record).from_buffer_copy(record)
        other.data = self.other.ptr
        return other


def test_launches_ask_a_derived_class_for_the_memory(device, tmp_path):
    @wp.kernel
    def twice(a: wp.array(dtype=float), out: wp.array(dtype=float)):
        i = wp.tid()
        out[i] = 2.0 * a[i]

    given = Redirected([1.0, 2.0], dtype=float, device=device)
    given.other = wp.array([3.0, 4.0], dtype=float, device=device)
    out = wp.zeros(2, dtype=float, device=device)
    wp.launch(twice, 2, [given, out], device=device)
    assert out.numpy().tolist() == [6.0, 8.0]
    with wp.ScopedCapture(device=device, apic=True) as capture:
        wp.launch(twice, 2, [given, out], device=device)
    given.other.fill_(5.0)
    wp.capture_launch(capture.graph)
    assert out.numpy().tolist() == [10.0, 10.0]
    # A saved graph finds the memory by its address.
    names = {"inputs": {"a": given.other}, "outputs": {"out": out}}
    wp.capture_save(capture.graph, tmp_path / "graph.wrp", **names)
    graph = wp.capture_load(tmp_path / "graph.wrp", device=device)
    graph.set_param("a", wp.array([7.0, 8.0], dtype=float, device=device))
    wp.capture_launch(graph)
    graph.get_param("out", out)
    assert out.numpy().tolist() == [14.0, 16.0]
    with pytest.raises(TypeError, match="expects .*float32"):
        wp.launch(twice, 2, [Redirected([1], dtype=int, device=device), out], device=device)
    given.__class__ = type("Bad", (Redirected,), {"__ctype__": lambda self: 7})
    with pytest.raises(TypeError, match="whose '__ctype__' gives no descriptor"):
        wp.launch(twice, 2, [given, out], device=device)
