"""Cases of the language that programs meet: results, names, casts, annotations."""

import ast
import enum

import numpy as np
import pytest

import warp as wp


class Kind(enum.IntEnum):
    FIRST = 3
    SECOND = 5


class Names:
    Kind = Kind


def run(kernel, *inputs, out=4, **options):
    result = wp.zeros(out, dtype=float, device="cpu")
    wp.launch(kernel, 1, inputs=[*inputs, result], device="cpu", **options)
    return list(result.numpy())


def test_members_of_enumerations():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = float(Kind.FIRST.value)
        out[1] = float(Kind.SECOND)
        out[2] = float(Names.Kind.SECOND.value)
        if wp.static(Kind.FIRST.name == "FIRST"):
            out[3] = 1.0

    assert run(kernel) == [3.0, 5.0, 5.0, 1.0]


@wp.func
def sometimes(x: float):
    if x > 0.0:
        return x
    elif x < -1.0:
        return -x


def test_a_path_without_return_gives_zero():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = sometimes(2.0)
        out[1] = sometimes(-3.0)
        out[2] = sometimes(-0.5) + 1.0

    assert run(kernel)[:3] == [2.0, 3.0, 1.0]


def test_an_explicit_cast_wraps_and_a_literal_does_not():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = float(wp.int8(300))
        out[1] = float(wp.uint8(-1))
        out[2] = float(wp.int16(40000))

    expected = [np.array(300).astype(np.int8), 255, np.array(40000).astype(np.int16)]
    assert run(kernel)[:3] == [float(number) for number in expected]

    @wp.kernel
    def literal(out: wp.array(dtype=float)):
        x = 3000000000
        out[0] = float(x)

    with pytest.raises(wp.WarpCodegenOverflowError, match="does not fit 'int32'"):
        run(literal)


def test_a_loop_counts_with_the_name_of_an_array():
    @wp.kernel
    def kernel(x: wp.array(dtype=float), n: int, out: wp.array(dtype=float)):
        first = x[0]
        total = float(0.0)
        for x in range(n):
            total += float(x)
        out[0] = total + first

    assert run(kernel, wp.full(1, 0.5, device="cpu"), 4)[0] == 6.5


def test_a_kernel_returns_nothing():
    @wp.kernel
    def annotated(out: wp.array(dtype=float)) -> float:
        out[0] = 1.0

    with pytest.raises(wp.WarpCodegenTypeError, match="cannot return a value"):
        run(annotated)

    @wp.kernel
    def declared(out: wp.array(dtype=float)) -> None:
        out[0] = 1.0

    assert run(declared)[0] == 1.0


@wp.func
def applied(f: wp.Function, x: float):
    return f(x)


def test_functions_as_parameters():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = applied(sometimes, 2.0)
        out[1] = applied(wp.sqrt, 9.0)

    assert run(kernel)[:2] == [2.0, 3.0]


def test_older_names():
    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        out[0] = wp.select(out[0] > 1.0, 2.0, 3.0)
        q = wp.quat_between_vectors(wp.vec3(1.0, 0.0, 0.0), wp.vec3(0.0, 2.0, 0.0))
        out[1] = wp.quat_rotate(q, wp.vec3(3.0, 0.0, 0.0))[1]
        q = wp.quat_between_vectors(wp.vec3(0.0, 1.0, 0.0), wp.vec3(0.0, -1.0, 0.0))
        out[2] = wp.quat_rotate(q, wp.vec3(0.0, 1.0, 0.0))[1]

    assert np.allclose(run(kernel)[:3], [2.0, 3.0, -1.0], atol=1e-6)


def test_results_in_python_have_the_type_of_the_arguments():
    assert type(wp.sin(0.5)) is float
    assert type(wp.sin(wp.float64(0.5))) is wp.float64
    assert abs(wp.sin(wp.float64(0.5)).value - np.sin(0.5)) < 1e-15
    assert type(wp.abs(wp.int8(-3))) is wp.int8
    assert type(wp.vec3d(1.0, 2.0, 3.0)[0]) is wp.float64
    assert type(wp.vec3(1.0, 2.0, 3.0)[0]) is float


def test_defaults_of_struct_fields():
    @wp.struct
    class Root:
        root: int = 0
        offset: wp.vec2 = wp.vec2(0.0, 0.0)

    @wp.kernel
    def kernel(out: wp.array(dtype=float)):
        r = Root()
        r.root += 2
        out[0] = float(r.root) + r.offset[1]

    assert run(kernel)[0] == 2.0
    with pytest.warns(UserWarning, match="default of field 'root' of struct 'Other' is not used"):

        @wp.struct
        class Other:
            root: int = 3

    assert Other().root == 0


def test_transformed_code():
    class Doubled(ast.NodeTransformer):
        def visit_Constant(self, node):
            return ast.Constant(node.value * 2.0) if node.value == 2.0 else node

    def kernel(out: wp.array(dtype=float)):
        out[0] = 2.0

    assert run(wp.Kernel(kernel, key="doubled", code_transformers=[Doubled()]))[0] == 4.0
    assert run(wp.Kernel(kernel, key="plain"))[0] == 2.0
