"""Vectors, matrices, quaternions and transforms at Python scope."""

import copy
import ctypes
import pickle
import typing

import numpy as np
import pytest

import warp as wp

SUFFIXES = "b ub s us i ui l ul h f d".split()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_names_exist(suffix):
    for n in (2, 3, 4):
        vec = getattr(wp, f"vec{n}{suffix}")
        assert (vec._length_, vec._shape_) == (n, (n,))
        assert vec.__name__ == f"vec{n}{suffix}"
        assert issubclass(vec, ctypes.Array)
    if suffix in "hfd":
        for n in (2, 3, 4):
            assert getattr(wp, f"mat{n}{n}{suffix}")._shape_ == (n, n)
        assert getattr(wp, f"quat{suffix}")._length_ == 4
        assert getattr(wp, f"transform{suffix}")._length_ == 7
        assert getattr(wp, f"spatial_vector{suffix}")._length_ == 6
        assert getattr(wp, f"spatial_matrix{suffix}")._shape_ == (6, 6)


def test_attributes_that_programs_read():
    assert wp.vec3 is wp.vec3f
    assert wp.vec3._wp_scalar_type_ is wp.float32
    assert wp.vec3._type_ is ctypes.c_float
    assert wp.vec3._wp_type_params_ == (3, wp.float32)
    assert wp.mat22._wp_type_params_ == (2, 2, wp.float32)
    assert wp.vec3._wp_generic_type_str_ == "vec_t"
    assert wp.mat22._wp_generic_type_str_ == "mat_t"


def test_factories_give_one_class_per_type():
    assert wp.types.vector(3, float) is wp.vec3
    assert wp.types.vector(length=5, dtype=float) is wp.types.vector(5, wp.float32)
    assert wp.types.matrix((2, 2), wp.float64) is wp.mat22d
    assert wp.types.matrix(shape=(4, 1), dtype=wp.int8)._length_ == 4
    assert wp.types.quaternion(float) is wp.quat
    assert wp.types.transformation(wp.float64) is wp.transformd
    assert wp.Vector[3, float] is wp.vec3
    assert wp.Matrix[float, 2, 2] is wp.mat22


@pytest.mark.parametrize(
    "make",
    [
        lambda: wp.types.vector(-1, float),
        lambda: wp.types.vector(3, str),
        lambda: wp.types.matrix((2,), float),
        lambda: wp.types.matrix((-1, 2), float),
        lambda: wp.types.quaternion(int),
    ],
)
def test_impossible_types(make):
    with pytest.raises((TypeError, ValueError)):
        make()


@pytest.mark.parametrize(
    "args, expected",
    [
        ((), (0, 0, 0)),
        ((2,), (2, 2, 2)),
        ((1, 2, 3), (1, 2, 3)),
        (((1, 2, 3),), (1, 2, 3)),
        (([1, 2, 3],), (1, 2, 3)),
        ((np.arange(3),), (0, 1, 2)),
        ((wp.vec3d(1, 2, 3),), (1, 2, 3)),
        ((wp.float32(1), np.float64(2), 3), (1, 2, 3)),
    ],
)
def test_vector_construction(args, expected):
    assert wp.vec3(*args) == expected


@pytest.mark.parametrize("args", [(1, 2), (1, 2, 3, 4), ((1, 2),), ([1, 2, 3, 4],)])
def test_wrong_number_of_components(args):
    with pytest.raises(ValueError, match="expects 3 components"):
        wp.vec3(*args)


@pytest.mark.parametrize("make", [lambda: wp.vec3("abc"), lambda: wp.vec3i(1.5, 2, 3)])
def test_wrong_components(make):
    with pytest.raises(TypeError):
        make()


def test_components():
    v = wp.vec4(1, 2, 3, 4)
    assert (v.x, v.y, v.z, v.w) == (1, 2, 3, 4)
    v.z = 7
    v[-1] = 9
    assert v == (1, 2, 7, 9)
    assert v[1:3] == (2, 7) and type(v[1:3]) is wp.vec2
    v[0:2] = 5
    v[2:] = (6, 6)
    assert v == (5, 5, 6, 6)
    assert [number for number in v] == [5, 5, 6, 6] and len(v) == 4
    with pytest.raises(IndexError):
        v[4]
    with pytest.raises(ValueError):
        v[0:2] = (1, 2, 3)
    with pytest.raises(AttributeError):
        wp.vec2().z
    with pytest.raises(AttributeError):
        wp.vec2().z = 1


@pytest.mark.parametrize("cls", [wp.vec3, wp.vec3d, wp.vec3h, wp.types.vector(3, wp.bfloat16)])
def test_float_arithmetic_matches_numpy(cls):
    a, b = cls(1, 2, 4), cls(0.5, -1, 8)
    x, y = np.array([1.0, 2.0, 4.0]), np.array([0.5, -1.0, 8.0])
    assert a + b == x + y
    assert a - b == x - y
    assert -a == -x
    assert a * 2 == 2.0 * a == 2 * x
    assert a / 2.0 == x / 2
    assert 8.0 / a == 8 / x


def test_int_arithmetic():
    assert wp.vec3i(7, -7, 9) / 2 == (3, -3, 4)
    assert wp.vec3i(7, -7, 9) % wp.vec3i(4, 4, 4) == (3, -3, 1)
    assert wp.vec3ub(200, 1, 2) + wp.vec3ub(100, 1, 2) == (44, 2, 4)


@pytest.mark.parametrize(
    "operation",
    [
        lambda v: v * v,
        lambda v: v + 1.0,
        lambda v: v + wp.vec3d(1, 2, 3),
        lambda v: v * wp.float64(2.0),
        lambda v: v * wp.quat(),
        lambda v: wp.mat22(1) * v,
        lambda v: wp.vec3i(1, 2, 3) * 2.5,
        lambda v: v + (1, 2, 3),
    ],
)
def test_operands_that_do_not_fit(operation):
    with pytest.raises(TypeError):
        operation(wp.vec3(1, 2, 3))


def test_half_vectors_show_scalars():
    v = wp.vec3h(0.1, 1, 2)
    assert isinstance(v[0], wp.float16)
    assert float(v[0]) == float(np.float16(0.1))


def test_equality_and_copies():
    v = wp.vec3(1, 2, 3)
    assert v == wp.vec3d(1, 2, 3) and v != wp.vec3(1, 2, 4) and v != (1, 2)
    for other in (copy.copy(v), copy.deepcopy(v), pickle.loads(pickle.dumps(v)), wp.vec3(v)):
        assert other == v and type(other) is wp.vec3
        other[0] = 9
    assert v[0] == 1
    with pytest.raises(TypeError):
        hash(v)
    assert repr(v) == "vec3f([1.0, 2.0, 3.0])"


def test_addresses():
    v = wp.vec3(1, 2, 3)
    assert wp.vec3.from_ptr(ctypes.addressof(v)) == v
    with pytest.raises(RuntimeError):
        wp.vec3.from_ptr(0)


def test_numpy_reads_without_copy():
    v = wp.vec3(1, 2, 3)
    assert np.asarray(v).dtype == np.float32
    assert np.array_equal(np.array(wp.mat22(1, 2, 3, 4)).reshape(2, 2), [[1, 2], [3, 4]])


def test_subclasses_keep_their_type():
    class State(wp.types.vector(length=5, dtype=float)):
        pass

    assert wp.types.types_equal(State, wp.types.vector(5, float))
    assert wp.types.canonical(State) is wp.types.vector(5, float)
    assert State(1) == (1,) * 5


@pytest.mark.parametrize(
    "args",
    [
        (1, 2, 3, 4),
        ([1, 2, 3, 4],),
        ([[1, 2], [3, 4]],),
        ([1, 2], [3, 4]),
        (wp.vec2(1, 2), wp.vec2(3, 4)),
        (np.array([[1, 2], [3, 4]]),),
    ],
)
def test_matrix_construction(args):
    m = wp.mat22(*args)
    assert m == [[1, 2], [3, 4]] or list(np.array(m)) == [1, 2, 3, 4]
    assert m[1, 0] == 3 and m[0] == (1, 2) and m[:, 1] == (2, 4)


def test_matrix_access():
    m = wp.mat33(*range(9))
    assert len(m) == 3
    assert m.get_row(1) == (3, 4, 5) and m.get_col(1) == (1, 4, 7)
    assert m[-1, -1] == 8
    assert type(m[0:2, 0:2]) is wp.mat22 and m[0:2, 0:2] == wp.mat22(0, 1, 3, 4)
    m.set_row(r=0, v=wp.vec3(9, 9, 9))
    m.set_col(c=2, v=1.0)
    m[1, 1] = 7
    m[2] = [4, 5, 6]
    assert m == wp.mat33(9, 9, 1, 3, 7, 1, 4, 5, 6)
    for key in (3, (0, 3)):
        with pytest.raises(IndexError):
            m[key]
    for key in ((0, 0, 0), None, (0, "x")):
        with pytest.raises(KeyError):
            m[key]
    with pytest.raises(ValueError):
        wp.mat22((1, 2, 3), (4, 5, 6))


def test_rows_are_copies():
    m = wp.mat22(1, 2, 3, 4)
    m[0][1] = 9
    assert m[0, 1] == 2


def test_matrix_products_match_numpy():
    rng = np.random.default_rng(1)
    a, b = rng.random((2, 3)), rng.random((3, 4))
    v, w = rng.random(3), rng.random(2)
    A = wp.types.matrix((2, 3), wp.float64)(a)
    B = wp.types.matrix((3, 4), wp.float64)(b)
    assert np.allclose(np.array(A * B).reshape(2, 4), a @ b, rtol=1e-15)
    assert np.allclose(np.array(A @ wp.vec3d(v)), a @ v, rtol=1e-15)
    assert np.allclose(np.array(wp.vec2d(w) * A), w @ a, rtol=1e-15)
    assert A * 2.0 == wp.types.matrix((2, 3), wp.float64)(2 * a)


def test_rows_and_columns_make_matrices():
    rows = (wp.vec3(1, 2, 3), wp.vec3(4, 5, 6))
    assert wp.matrix_from_rows(*rows)[1] == (4, 5, 6)
    assert wp.matrix_from_cols(*rows)[:, 1] == (4, 5, 6)
    with pytest.raises(TypeError):
        wp.matrix_from_rows(wp.vec2(), wp.vec3())


def test_quaternions_and_transforms():
    half_turn = wp.quat(0, 0, 1, 0)
    assert half_turn * half_turn == (0, 0, 0, -1)
    assert wp.quat(wp.vec3(1, 2, 3), 4.0) == (1, 2, 3, 4)
    t = wp.transform(wp.vec3(1, 2, 3), half_turn)
    assert t.p == (1, 2, 3) and t.q == half_turn and type(t.q) is wp.quat
    assert wp.transform() == (0, 0, 0, 0, 0, 0, 1)
    assert (t * t).p == (0, 0, 6)
    t.p = (7, 8, 9)
    assert t[:3] == (7, 8, 9)
    assert wp.transform(p=(1, 2, 3)) == (1, 2, 3, 0, 0, 0, 1)


@wp.struct
class Ball:
    radius: float


def test_questions_about_types():
    t = wp.types
    assert t.type_size_in_bytes(wp.vec3) == 12 and t.type_size(wp.mat33) == 9
    assert t.type_repr(float) == "float32" and t.type_repr(wp.vec3) == "vec3f"
    assert t.types_equal(float, wp.float32) and not t.types_equal(wp.vec3, wp.vec3d)
    assert t.is_vector(wp.vec3()) and not t.is_vector(wp.quat()) and t.is_quaternion(wp.quat())
    assert t.type_is_matrix(wp.mat22) and t.is_transformation(wp.transform())
    assert t.is_int(3) and t.is_float(wp.float16(3)) and not t.is_int(wp.bool(1))
    assert not t.is_matrix(wp.mat22) and not t.type_is_float(wp.float16(3)) and not t.is_int(int)
    assert t.is_struct(Ball()) and not t.is_struct(Ball)
    assert t.type_is_struct(Ball) and not t.type_is_struct(Ball())
    for dtype in (wp.float16, wp.vec3, wp.mat33d, wp.quat, wp.transformh):
        assert t.dtype_of(t.native_text(dtype)) is dtype
    with pytest.raises(TypeError, match="'str'"):
        t.canonical(str)


def test_transforms_multiply_in_python_as_in_kernels():
    a = wp.transform(wp.vec3(1.0, 2.0, 3.0), wp.quat(0.1, -0.3, 0.5, 0.8))
    b = wp.transform(wp.vec3(-2.0, 0.5, 4.0), wp.quat(0.7, 0.1, 0.1, -0.7))
    product = wp.transform_multiply(a, b)
    assert list(a * b) == pytest.approx(list(product), rel=1e-6)


def test_types_by_subscript():
    three = typing.Literal[3]
    assert wp.Vector[wp.float32, three] is wp.Vector[three, float] is wp.vec3
    assert wp.Matrix[wp.float64, three, three] is wp.mat33d
    assert wp.Quaternion[wp.float16] is wp.quath
    assert wp.Transformation[float] is wp.transform
    assert wp.types.type_is_vector(wp.Vector[wp.float32, 5])
    for family, parameters in (
        (wp.Vector, (float, typing.Literal[2, 3])),
        (wp.Vector, (float, -1)),
        (wp.Matrix, (float, 0, 3)),
    ):
        with pytest.raises(TypeError):
            family[parameters]


@pytest.mark.parametrize(
    "arguments, named, message",
    [
        ((1.5, 2.5), {}, "transform expects a sequence as 'p', but got 'float'"),
        (((1, 2, 3), 1.0), {}, "transform expects a sequence as 'q', but got 'float'"),
        ((), {"p": 1.0}, "transform expects a sequence as 'p', but got 'float'"),
        ((), {"q": 1.0}, "transform expects a sequence as 'q', but got 'float'"),
        ((object(),), {}, "transform expects numbers, but got 'object'"),
        (range(7), {"q": (0, 0, 0, 1)}, "multiple values for argument 'q'"),
        (range(7), {"pos": (0, 0, 0)}, "got an unexpected keyword argument 'pos'"),
    ],
)
def test_transforms_refuse_parts_that_are_none(arguments, named, message):
    with pytest.raises(TypeError, match=message):
        wp.transform(*arguments, **named)


def test_transforms_of_parts():
    assert list(wp.transform(q=(1, 2, 3, 4))) == [0, 0, 0, 1, 2, 3, 4]
    assert list(wp.transform(wp.vec3(1, 2, 3), q=wp.quat(4, 5, 6, 7))) == [1, 2, 3, 4, 5, 6, 7]
    assert list(wp.transform(2.0)) == [2.0] * 7
    assert list(wp.transform(np.float32(2))) == [2.0] * 7
