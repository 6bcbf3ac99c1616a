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
