"""Memory that must not be written: reading is as ever, a write is an error that names the array."""

import ctypes
import mmap

import numpy as np
import pytest

import warp as wp

N = 8


@wp.struct
class Held:
    values: wp.array(dtype=float)
    scale: float


@wp.struct
class Outer:
    count: int
    inner: Held


@wp.func
def put(a: wp.array(dtype=float), i: int, value: float):
    a[i] = value


@wp.kernel
def read(a: wp.array(dtype=float), result: wp.array(dtype=float)):
    i = wp.tid()
    result[i] = 2.0 * a[i]


@wp.kernel
def store(a: wp.array(dtype=float), s: float):
    i = wp.tid()
    a[i] = a[i] * s


@wp.kernel
def store_in_function(a: wp.array(dtype=float), s: float):
    i = wp.tid()
    if s > 100.0:
        put(a, i, s)


@wp.kernel
def add(a: wp.array(dtype=float), s: float):
    wp.atomic_add(a, wp.tid(), s)


@wp.kernel
def update(a: wp.array(dtype=float), s: float):
    a[wp.tid()] += s


@wp.kernel
def store_tile(a: wp.array(dtype=float), s: float):
    wp.tile_store(a, wp.tile_ones(shape=N, dtype=float))


@wp.kernel
def store_vectors(a: wp.array(dtype=wp.vec2), s: float):
    a[wp.tid()][1] = s


@wp.kernel
def read_struct(o: Outer, result: wp.array(dtype=float)):
    i = wp.tid()
    result[i] = 2.0 * o.inner.values[i]


@wp.kernel
def store_struct(o: Outer):
    o.inner.values[wp.tid()] = 1.0


@wp.kernel
def read_chosen(a: wp.indexedarray(dtype=float), result: wp.array(dtype=float)):
    i = wp.tid()
    result[i] = 2.0 * a[i]


@wp.kernel
def store_chosen(a: wp.indexedarray(dtype=float)):
    a[wp.tid()] = 1.0


class Interface:
    """An object that describes its memory, as libraries do."""

    def __init__(self, source):
        self.source = source
        self.__array_interface__ = source.__array_interface__


def values():
    return np.arange(1, N + 1, dtype=np.float32)


def flagged(path):
    found = values()
    found.flags.writeable = False
    return found


def of_bytes(path):
    return np.frombuffer(values().tobytes(), np.float32)


def mapped(path):
    values().tofile(path)
    return np.memmap(path, dtype=np.float32, mode="r")


def of_mmap(path):
    values().tofile(path)
    with open(path, "rb") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.float32)


def view_of_bytes(path):
    return np.asarray(memoryview(values().tobytes()).cast("f"))


def broadcast(path):
    return np.broadcast_to(values(), (2, N))[1]


SOURCES = [flagged, of_bytes, mapped, of_mmap, view_of_bytes, broadcast]
FORMS = {
    "argument": lambda source: source,
    "interface": Interface,
    "array": lambda source: wp.array(source, dtype=float, device="cpu", copy=False),
    "view": lambda source: (
        wp.array(source, copy=False, device="cpu").reshape((2, N // 2)).flatten()
    ),
    "again": lambda source: wp.array(wp.array(source, copy=False, device="cpu"), copy=False),
    "dlpack": lambda source: wp.from_dlpack(source),
    "shaped": lambda source: wp.array(source, shape=(2, 4), copy=False, device="cpu").flatten(),
}
WRITERS = [store, store_in_function, add, update, store_tile]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("tape", [False, True])
def test_kernels_may_read_and_not_write(source, form, tape, tmp_path):
    """The error names kernel and argument, and says in which line the kernel writes."""
    memory = source(tmp_path / "values")
    a, result = FORMS[form](memory), wp.zeros(N, dtype=float, device="cpu")
    with wp.Tape() if tape else wp.ScopedDevice("cpu"):
        wp.launch(read, N, [a], [result], device="cpu")
        np.testing.assert_array_equal(result.numpy(), 2 * values())
        for kernel in WRITERS:
            for launch in (wp.launch, wp.launch_tiled) if kernel is store_tile else (wp.launch,):
                with pytest.raises(ValueError, match=rf"{kernel.key}.*'a' is a read-only.*line \d"):
                    launch(kernel, [1], [a, 5.0], device="cpu", block_dim=32)
    np.testing.assert_array_equal(memory, values())


def test_recorded_launches():
    a, free = flagged(None), wp.zeros(N, dtype=float, device="cpu")
    with pytest.raises(ValueError, match="'a' is a read-only"):
        wp.launch(store, N, [a, 1.0], device="cpu", record_cmd=True)
    made = wp.launch(store, N, [free, 1.0], device="cpu", record_cmd=True)
    with pytest.raises(ValueError, match="'a' is a read-only"):
        made.set_param_at_index(0, a)
    made.launch()


def test_elements_that_are_vectors():
    memory = values().reshape(N // 2, 2)
    memory.flags.writeable = False
    for a in (memory, wp.array(memory, dtype=wp.vec2, copy=False, device="cpu")):
        with pytest.raises(ValueError, match="'a' is a read-only"):
            wp.launch(store_vectors, 2, [a, 5.0], device="cpu")
    np.testing.assert_array_equal(memory.ravel(), values())


@pytest.mark.parametrize("form", ["array", "view", "dlpack"])
def test_fields_of_structs_and_chosen_elements(form):
    a, result = FORMS[form](flagged(None)), wp.zeros(N, dtype=float, device="cpu")
    outer = Outer()
    outer.inner.values = a
    places = wp.array(np.arange(N), dtype=int, device="cpu")
    chosen = wp.indexedarray(a, [places])
    for kernel, value in ((read_struct, outer), (read_chosen, chosen)):
        wp.launch(kernel, N, [value], [result], device="cpu")
        np.testing.assert_array_equal(result.numpy(), 2 * values())
    for kernel, value in ((store_struct, outer), (store_chosen, chosen)):
        name = "o" if kernel is store_struct else "a"
        with pytest.raises(ValueError, match=rf"'{name}' holds a read-only array.*line \d"):
            wp.launch(kernel, N, [value], device="cpu")
    # A field that is replaced, and the same array read from a struct made of bytes.
    copied = Outer.from_buffer_copy(outer)
    assert copied.inner.values.read_only
    outer.inner.values = result
    wp.launch(store_struct, N, [outer], device="cpu")


WRITES = {
    "fill_": lambda a: a.fill_(1.0),
    "fill": lambda a: a[:2].fill(1.0),
    "zero_": lambda a: a.zero_(),
    "assign": lambda a: a.assign(np.zeros(N)),
    "item": lambda a: a.__setitem__(slice(0, 2), 1.0),
    "items": lambda a: a.__setitem__(slice(0, 2), [1.0, 2.0]),
    "copy": lambda a: wp.copy(a, wp.zeros(N, dtype=float, device="cpu")),
    "part": lambda a: wp.copy(a, wp.zeros(2, dtype=float, device="cpu"), count=2),
    "+=": lambda a: a.__iadd__(1.0),
    "map": lambda a: wp.map(wp.add, a, 1.0, out=a),
    "scan": lambda a: wp.utils.array_scan(wp.zeros(N, dtype=float, device="cpu"), a),
    "sort": lambda a: wp.utils.radix_sort_pairs(a, wp.zeros(N, dtype=int, device="cpu"), N // 2),
    "cast": lambda a: wp.utils.array_cast(wp.zeros(N, dtype=wp.float64, device="cpu"), a),
    "chosen": lambda a: wp.indexedarray(a, wp.array([1, 2], dtype=int, device="cpu")).fill_(3.0),
    "sparse": lambda a: wp.sparse.bsr_mv(wp.sparse.bsr_identity(N, float, device="cpu"), a, a),
    "gradient": lambda a: setattr(wp.zeros(N, dtype=float, device="cpu"), "grad", a),
    "numpy": lambda a: a.numpy().__setitem__(0, 1.0),
}


@pytest.mark.parametrize("source", SOURCES[:3])
@pytest.mark.parametrize("write", WRITES)
def test_everything_else_that_writes(source, write, tmp_path):
    memory = source(tmp_path / "values")
    a = wp.array(memory, copy=False, device="cpu")
    with pytest.raises(ValueError, match="read-only"):
        WRITES[write](a)
    np.testing.assert_array_equal(memory, values())


def test_reading_shares_and_copies_are_free():
    memory = flagged(None)
    a = wp.array(memory, copy=False, device="cpu")
    assert a.read_only and a.ptr == memory.ctypes.data
    assert not a.numpy().flags.writeable and not np.asarray(a).flags.writeable
    for b in (wp.clone(a), wp.array(memory, device="cpu"), a + 0.0, a[::2].contiguous()):
        assert not b.read_only
        b.fill_(0.0)
    assert float(wp.utils.array_sum(a)) == values().sum()
    with pytest.raises(AttributeError):
        a.read_only = False


def test_gradients():
    """Derivatives may be seeded from such memory, and not added to it."""
    x, y = (wp.zeros(N, dtype=float, device="cpu", requires_grad=True) for _ in range(2))
    seed = flagged(None)
    options = {"adjoint": True, "device": "cpu"}
    wp.launch(read, N, [x], [y], adj_inputs=[x.grad], adj_outputs=[seed], **options)
    np.testing.assert_array_equal(x.grad.numpy(), 2 * values())
    with pytest.raises(ValueError, match="read.*'a'.*read-only"):
        wp.launch(read, N, [x], [y], adj_inputs=[seed], adj_outputs=[y.grad], **options)
    np.testing.assert_array_equal(seed, values())


@wp.kernel
def square(a: wp.array(dtype=float), o: Outer, result: wp.array(dtype=float)):
    i = wp.tid()
    result[i] = a[i] * a[i] + 3.0 * o.inner.values[i]


def test_derivatives_of_what_reads_them():
    """Such an array may have a gradient of its own, in launches, structs and maps on tapes."""
    a, b = (wp.array(flagged(None), copy=False, device="cpu") for _ in range(2))
    a.requires_grad = b.requires_grad = True
    outer = Outer()
    outer.inner.values = b
    y, z = (wp.zeros(N, dtype=float, device="cpu", requires_grad=True) for _ in range(2))
    for _ in range(2):
        with wp.Tape() as tape:
            wp.launch(square, N, [a, outer], [y], device="cpu")
            wp.map(wp.mul, a, 2.0, out=z)
        seed = wp.array(flagged(None), copy=False, device="cpu")
        tape.backward(grads={y: seed, z: wp.ones_like(z)})
        np.testing.assert_array_equal(a.grad.numpy(), 2 * values() ** 2 + 2)
        np.testing.assert_array_equal(b.grad.numpy(), 3 * values())
        tape.zero()
    np.testing.assert_array_equal(a.numpy(), values())


def test_a_descriptor_keeps_the_mark():
    a = wp.array(flagged(None), copy=False, device="cpu")
    described = a.__ctype__()
    assert isinstance(described, ctypes.Structure)
    with pytest.raises(ValueError, match="'a' is a read-only"):
        wp.launch(store, N, [described, 1.0], device="cpu")
