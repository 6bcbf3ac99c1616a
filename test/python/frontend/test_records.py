"""Records: descriptions with parts, operators on them, and gradients by first arguments."""

import dataclasses

import numpy as np
import pytest

import warp as wp
from warp import extend


class Curve:
    """The tag of parameters that take curves."""

    is_open = True

    @staticmethod
    def fits(native):
        return False


@wp.struct
class Coefficients:
    values: wp.array(dtype=float)


@wp.func
def polynomial_value(arg: Coefficients, x: float):
    return arg.values[0] + x * arg.values[1]


@wp.func
def constant_value(number: float, x: float):
    return number


@dataclasses.dataclass(frozen=True)
class Polynomial(extend.Description, Curve):
    degree: int

    def operation(self, name, count):
        if name == "degree":
            return extend.Static(self.degree)
        if name == "flat":
            return extend.Recast(Constant(), polynomial_value) if count == 0 else None
        return polynomial_value if name in ("()", "value") else None

    def __str__(self):
        return f"polynomial of degree {self.degree}"


@dataclasses.dataclass(frozen=True)
class Constant(extend.Description, Curve):
    def operation(self, name, count):
        return constant_value if name in ("()", "value") else None


value = extend.Operator("value")
degree = extend.Operator("degree")
slope = extend.Operator("slope")
LINEAR, CONSTANT = Polynomial(1), Constant()


@wp.func
def product(u: Curve, v: Curve, x: float):
    w = u
    return w(x) * value(v, x)


@wp.func
def by_number(number: float, arg: Coefficients, x: float):
    return product(CONSTANT(number), LINEAR(arg), x)


def coefficients():
    arg = Coefficients()
    arg.values = wp.array([1.0, 2.0], dtype=float, device="cpu")
    return arg


def test_call_resolves_to_the_description():
    @wp.kernel
    def kernel(arg: Coefficients, out: wp.array(dtype=float)):
        out[0] = product(LINEAR(arg), CONSTANT(3.0), 2.0)
        out[1] = float(degree(LINEAR(arg)))

    out = wp.zeros(2, dtype=float, device="cpu")
    wp.launch(kernel, 1, [coefficients(), out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), [15.0, 1.0])


def test_gradient_by_first_argument_leaves_structs_out():
    gradient_by = extend.gradient_by

    @wp.kernel
    def kernel(arg: Coefficients, out: wp.array(dtype=float)):
        (slope_of_number,) = gradient_by(by_number, 1)(7.0, arg, 2.0)
        out[0] = slope_of_number

    out = wp.zeros(1, dtype=float, device="cpu")
    wp.launch(kernel, 1, [coefficients(), out], device="cpu")
    np.testing.assert_array_equal(out.numpy(), [5.0])


def test_missing_operator_names_description_and_line():
    @wp.kernel
    def kernel(arg: Coefficients, out: wp.array(dtype=float)):
        out[0] = slope(LINEAR(arg), 2.0)

    out = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(wp.WarpCodegenError, match="'slope' is not defined for") as caught:
        wp.launch(kernel, 1, [coefficients(), out], device="cpu")
    assert "polynomial of degree 1" in str(caught.value)
    assert "slope(LINEAR(arg), 2.0)" in str(caught.value)


def test_parameter_refuses_other_values():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = product(1.0, CONSTANT(2.0), 2.0)

    out = wp.zeros(1, dtype=float, device="cpu")
    with pytest.raises(wp.WarpCodegenTypeError, match="argument 'u' does not take 'float32'"):
        wp.launch(kernel, 1, [out], device="cpu")


def test_lasting_name_goes_by_fields():
    from warp._src.kernels.identity import Identity

    def digest(*values):
        identity = Identity()
        for one in values:
            identity.add(one)
        return identity.digest()

    assert digest(Polynomial(1), value) == digest(Polynomial(1), extend.Operator("value"))
    assert digest(Polynomial(1)) != digest(Polynomial(2))
    assert digest(value) != digest(degree)
