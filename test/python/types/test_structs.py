"""`@wp.struct`: declaration, instances, layout, arrays of structs."""

import copy
import ctypes
import typing

import numpy as np
import pytest

import warp as wp


@wp.struct
class Inner:
    a: wp.float16
    b: wp.vec3


@wp.struct
class Outer:
    x: float
    n: int
    flag: wp.bool
    v: wp.vec3
    m: wp.mat22
    values: wp.array(dtype=float)
    inner: Inner
    d: wp.float64


def test_new_instances_are_zero():
    s = Outer()
    assert (s.x, s.n, s.flag, s.values, s.d) == (0.0, 0, False, None, 0.0)
    assert s.v == (0, 0, 0) and s.inner.b == (0, 0, 0)


def test_assignment_and_nesting():
    s = Outer(x=2)
    s.v = (1, 2, 3)
    s.v[1] = 9
    s.inner.a = 2.5
    s.inner.b = np.array([4.0, 5.0, 6.0])
    s.m = [[1, 2], [3, 4]]
    s.flag = True
    inner = s.inner
    inner.b[0] = 7
    assert s.x == 2.0 and s.v == (1, 9, 3) and s.inner.a == 2.5
    assert s.inner.b == (7, 5, 6) and s.m == wp.mat22(1, 2, 3, 4) and s.flag is True
    other = Inner(a=1)
    s.inner = other
    other.a = 3
    assert s.inner.a == 1


def test_composites_are_copied():
    s = Outer()
    v = wp.vec3(1, 2, 3)
    s.v = v
    v[0] = 9
    assert s.v == (1, 2, 3)


@pytest.mark.parametrize(
    "field, value, error",
    [
        ("x", "a", TypeError),
        ("x", None, TypeError),
        ("n", 2.5, TypeError),
        ("v", 1.0, TypeError),
        ("v", (1, 2), ValueError),
        ("v", wp.vec2(), TypeError),
        ("m", (1, 2), ValueError),
        ("inner", None, TypeError),
        ("inner", 3, TypeError),
        ("values", 3, TypeError),
        ("values", np.zeros(3), TypeError),
        ("unknown", 3, AttributeError),
    ],
)
def test_bad_assignment(field, value, error):
    s = Outer()
    with pytest.raises(error, match=field):
        setattr(s, field, value)


def test_array_fields(device):
    s = Outer()
    values = wp.zeros(3, device=device)
    s.values = values
    assert s.values is values
    descriptor = s.__ctype__()
    assert bytes(descriptor)[Outer.values.offset :][:8] == values.ptr.to_bytes(8, "little")
    for bad in (wp.zeros((2, 2), device=device), wp.zeros(3, dtype=int, device=device)):
        with pytest.raises(TypeError, match="values"):
            s.values = bad
    s.values = None
    assert s.values is None


def test_none_clears_a_composite():
    s = Outer()
    s.v = wp.vec3(1.0, 2.0, 3.0)
    s.v = None
    assert s.v == wp.vec3()
    for bad in (1.0, wp.float32(2.0)):
        with pytest.raises(TypeError, match="expects 'vec3f', but got") as caught:
            s.v = bad
        assert caught.value.code == "field-type"


def test_layout_is_that_of_c():
    class Expected(ctypes.Structure):
        _fields_ = [
            ("x", ctypes.c_float),
            ("n", ctypes.c_int),
            ("flag", ctypes.c_bool),
            ("v", ctypes.c_float * 3),
            ("m", ctypes.c_float * 4),
            ("values", ctypes.c_uint64 * 7),
            ("inner", ctypes.c_byte * 16),
            ("d", ctypes.c_double),
        ]

    assert ctypes.sizeof(Outer) == ctypes.sizeof(Expected)
    for name, _ in Expected._fields_:
        assert getattr(Outer, name).offset == getattr(Expected, name).offset
    assert np.dtype(Outer.numpy_dtype()).itemsize == ctypes.sizeof(Outer)
    assert wp.types.type_size_in_bytes(Inner) == 16


def test_description():
    assert Outer.key == "Outer"
    assert list(Inner.vars) == ["a", "b"] and Inner.vars["b"].type is wp.vec3
    assert wp.types.native_text(Inner) == '!warp.struct<"Inner", {a: f16, b: !warp.vec<3 x f32>}>'
    assert wp.types.dtype_of(wp.types.native_text(Inner)) is Inner
    assert isinstance(Inner(), Inner) and wp.types.type_is_struct(Inner)


def test_assign_copy_and_record():
    s = Inner(a=1.5, b=(1, 2, 3))
    t = Inner().assign(s)
    c = copy.copy(s)
    s.a = 9
    assert t.a == c.a == 1.5 and t.b == (1, 2, 3)
    record = t.numpy_value()
    assert record["a"] == 1.5 and record["b"].tolist() == [1, 2, 3]
    assert Inner.from_ptr(ctypes.addressof(t)).b == (1, 2, 3)
    with pytest.raises(TypeError):
        t.assign(Outer())


def test_to_moves_arrays(device):
    s = Outer(x=3)
    s.values = wp.full(2, 7.0, device=device)
    moved = s.to("cpu")
    assert moved.x == 3 and moved.values.device == "cpu"
    assert moved.values.numpy().tolist() == [7, 7]


def test_arrays_of_structs(device):
    items = [Inner(a=i, b=(i, 2 * i, 3 * i)) for i in range(4)]
    array = wp.array(items, dtype=Inner, device=device)
    assert array.shape == (4,) and array.item_size == 16
    records = array.numpy()
    assert records["a"].tolist() == [0, 1, 2, 3] and records["b"][3].tolist() == [3, 6, 9]
    assert array.list()[2].b == (2, 4, 6)
    again = wp.array(records, dtype=Inner, device=device)
    assert np.array_equal(again.numpy(), records)
    assert not wp.zeros((2, 2), dtype=Inner, device=device).numpy()["a"].any()
    array.fill_(items[1])
    assert array.numpy()["a"].tolist() == [1, 1, 1, 1]


def test_bad_arrays_of_structs(device):
    with pytest.raises(TypeError):
        wp.array([1.0, 2.0], dtype=Inner, device=device)
    with pytest.raises(TypeError):
        wp.array([Outer()], dtype=Inner, device=device)
    with pytest.raises(TypeError):
        wp.zeros(2, dtype=Inner, device=device).fill_(Outer())


def test_bad_declarations():
    class Unknown:
        x: str

    class Open:
        x: typing.Any

    class AnyRank:
        x: wp.array[float, typing.Any]

    class AnyFabricRank:
        x: wp.indexedfabricarray[float, typing.Any]

    class Derived(Unknown):
        y: float

    class Reserved:
        assign: float

    for cls, message in (
        (Unknown, "field 'x' of struct 'Unknown'.*'str'"),
        (Open, "concrete type"),
        (AnyRank, "field 'x' of struct 'AnyRank'.*number of dimensions open"),
        (AnyFabricRank, "field 'x' of struct 'AnyFabricRank'.*number of dimensions open"),
        (Derived, "inherit"),
        (Reserved, "taken"),
    ):
        with pytest.raises(TypeError, match=message):
            wp.struct(cls)
    with pytest.raises(TypeError):
        wp.struct(lambda x: x)


def test_text():
    assert repr(Inner(a=1.5, b=(1, 2, 3))) == "Inner(\n\ta=1.5,\n\tb=vec3f([1.0, 2.0, 3.0]),\n)"
    assert "\tinner=Inner(\n\t\ta=0.0" in repr(Outer())


@wp.struct
class Pointers:
    a: wp.array(dtype=float)
    b: wp.array2d(dtype=wp.vec3)


@wp.kernel
def copy_pointers(source: wp.array(dtype=Pointers), target: wp.array(dtype=Pointers)):
    i = wp.tid()
    target[i] = source[i]


def test_arrays_that_kernels_store_have_no_gradient(device):
    a = wp.zeros(3, dtype=float, device=device, requires_grad=True)
    b = wp.zeros((2, 2), dtype=wp.vec3, device=device)
    source = wp.array([Pointers(a=a, b=b)], dtype=Pointers, device=device)
    # The former arrays had gradients; they are not those of the new arrays.
    old = Pointers(a=wp.zeros_like(a), b=wp.zeros_like(b, requires_grad=True))
    target = wp.array([old], dtype=Pointers, device=device)
    wp.launch(copy_pointers, 1, [source, target], device=device)
    stored = target.numpy()[0]
    for field, one in (("a", a), ("b", b)):
        found = stored[field]
        assert (found["data"], found["grad"], found["flags"]) == (one.ptr, 0, 0)
        assert found["ndim"] == one.ndim
        assert found["shape"][: one.ndim].tolist() == list(one.shape)
        assert found["strides"][: one.ndim].tolist() == list(one.strides)


def test_descriptors_lie_as_the_compiler_has_them():
    from warp import _native
    from warp._src.types.struct_fields import ArrayDescriptor

    layout = np.dtype(ArrayDescriptor.numpy_format)
    assert ctypes.sizeof(ArrayDescriptor) == layout.itemsize == _native.DESCRIPTOR_SIZE
    for name, offset, size, count in _native.DESCRIPTOR_FIELDS:
        field = getattr(ArrayDescriptor, name)
        assert (field.offset, field.size) == (offset, size * count)
        assert layout.fields[name][1] == offset
    x = wp.zeros((2, 3), dtype=wp.vec2, device="cpu")
    known = ArrayDescriptor.from_buffer_copy(x.descriptor())
    assert (known.data, known.ndim) == (x.ptr, 2)
    assert (list(known.shape[:2]), list(known.strides[:2])) == ([2, 3], [24, 8])


def test_words_of_refused_types_are_those_that_programs_look_for(monkeypatch):
    """Both packages' words, and the classes of both."""
    monkeypatch.setattr(wp.config, "peer_messages", True)
    with pytest.raises(RuntimeError, match="must be defined as base classes$") as caught:

        @wp.struct
        class Derived(int):
            y: float

    assert isinstance(caught.value, TypeError)
    words = r"exactly two dimensions, got 1 dimension in shape \(2,\)"
    with pytest.raises(ValueError, match=words):
        wp.types.matrix((2,), wp.float32)


@wp.struct
class Adjacency:
    """A struct with what Python has besides."""

    offsets: wp.array(dtype=int)
    scale: float

    LIMIT = 4

    def __init__(self, scale):
        raise RuntimeError("is not called")

    def to(self, device):
        moved = Adjacency()
        moved.offsets, moved.scale = self.offsets.to(device), 2.0 * self.scale
        return moved

    @property
    def count(self):
        return self.offsets.size - 1

    @staticmethod
    def doubled(x):
        return 2 * x

    @classmethod
    def unit(cls):
        made = cls()
        made.scale = 1.0
        return made

    def __len__(self):
        return self.count


@wp.kernel
def read_adjacency(info: Adjacency, out: wp.array(dtype=float)):
    out[wp.tid()] = info.scale * float(info.offsets[wp.tid()])


def test_methods_and_properties_are_for_python():
    info = Adjacency.unit()
    info.offsets = wp.array([0, 2, 5], dtype=int, device="cpu")
    moved = info.to("cpu")
    assert (info.scale, moved.scale, moved.count, len(moved)) == (1.0, 2.0, 2, 2)
    assert Adjacency.LIMIT == 4 and info.doubled(3) == 6
    out = wp.zeros(3, dtype=float, device="cpu")
    wp.launch(read_adjacency, 3, [moved], [out], device="cpu")
    assert out.numpy().tolist() == [0.0, 4.0, 10.0]
    with pytest.raises(AttributeError):
        info.count = 3


def test_kernels_do_not_call_methods():
    @wp.kernel
    def call(info: Adjacency, out: wp.array(dtype=int)):
        out[0] = info.doubled(2)

    with pytest.raises(wp.WarpCodegenError, match="doubled"):
        wp.launch(call, 1, [Adjacency.unit(), wp.zeros(1, dtype=int, device="cpu")], device="cpu")
