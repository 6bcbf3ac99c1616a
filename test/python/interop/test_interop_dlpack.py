"""DLPack: what goes out comes back, shares memory, and lives as long as it is used."""

import gc
import subprocess
import sys
import weakref

import numpy as np
import pytest

import warp as wp

SCALARS = [t for t in (*wp.types.SCALAR_TYPES, wp.bool) if t is not wp.bfloat16]
READ_ONLY, COPIED = 1, 2
CPU, CUDA = 1, 2


class Producer:
    """Passes on the capsules of an array, and records what it was asked for."""

    def __init__(self, array, versioned=True):
        self.array, self.versioned, self.asked = array, versioned, None

    def __dlpack_device__(self):
        return self.array.__dlpack_device__()

    def __dlpack__(self, **options):
        if not self.versioned and "max_version" in options:
            raise TypeError("no argument 'max_version'")
        self.asked = options
        return self.array.__dlpack__(**options)


def inspect(array, **options):
    """(shape, strides, flags) of an exported capsule."""
    found = wp._native.dlpack_inspect(array.__dlpack__(**options))
    return found[6:]


@pytest.fixture(params=["versioned", "legacy"])
def producer(request):
    return lambda array: Producer(array, request.param == "versioned")


# Memory is shared, whichever kind of capsule carries it.
def test_round_trip_shares_memory(device, producer):
    a = wp.array(np.arange(6, dtype=np.float32), device=device)
    b = wp.from_dlpack(producer(a))
    assert (b.shape, b.dtype, str(b.device)) == ((6,), wp.float32, device)
    assert b.ptr == a.ptr
    a.fill_(4.0)
    np.testing.assert_array_equal(b.numpy(), np.full(6, 4.0))


@pytest.mark.parametrize("dtype", [*SCALARS, wp.bfloat16], ids=lambda t: t.__name__)
def test_scalar_types(device, producer, dtype):
    a = wp.ones(3, dtype=dtype, device=device)
    b = wp.from_dlpack(producer(a))
    assert b.dtype is dtype
    assert b.list() == a.list()


@pytest.mark.parametrize("dtype", SCALARS, ids=lambda t: t.__name__)
def test_numpy_takes_and_gives(dtype):
    a = wp.ones((2, 3), dtype=dtype, device="cpu")
    view = np.from_dlpack(a)
    assert view.dtype == wp.dtype_to_numpy(dtype)
    assert view.ctypes.data == a.ptr
    source = np.ones((2, 3), dtype=view.dtype)
    b = wp.from_dlpack(source)
    assert b.dtype is dtype
    assert b.ptr == source.ctypes.data


# Vectors and matrices are trailing dimensions outside.
@pytest.mark.parametrize(
    "dtype, inner",
    [
        (wp.vec3, (3,)),
        (wp.mat22, (2, 2)),
        (wp.types.matrix((2, 5), wp.float64), (2, 5)),
        (wp.quat, (4,)),
        (wp.transform, (7,)),
        (wp.vec4ub, (4,)),
    ],
    ids=str,
)
def test_composites(device, producer, dtype, inner):
    a = wp.zeros((4, 2), dtype=dtype, device=device)
    plain = wp.from_dlpack(producer(a))
    assert plain.shape == (4, 2, *inner)
    again = wp.from_dlpack(producer(a), dtype=dtype)
    assert (again.shape, again.dtype, again.strides) == ((4, 2), dtype, a.strides)
    assert again.ptr == a.ptr


def test_one_composite_and_one_number():
    assert wp.from_dlpack(np.zeros(3, np.float32), dtype=wp.vec3).shape == (1,)
    assert wp.from_dlpack(np.float64(3).reshape(())[...].copy()).shape == (1,)


def test_integers_of_either_sign():
    a = wp.from_dlpack(np.full(2, 255, np.uint8), dtype=wp.int8)
    assert a.list() == [-1, -1]


# Strides count elements in DLPack and bytes here.
def test_strides(device, producer):
    numbers = np.arange(24, dtype=np.float64).reshape(4, 6)
    a = wp.array(numbers, device=device)
    for view, expected in ((a[1:, ::2], numbers[1:, ::2]), (a.transpose(), numbers.T)):
        b = wp.from_dlpack(producer(view))
        assert b.strides == view.strides
        np.testing.assert_array_equal(b.numpy(), expected)


def test_strides_of_components_that_do_not_divide():
    records = np.zeros(3, dtype=[("byte", "i1"), ("number", "f4")])
    a = wp.array(ptr=records.ctypes.data + 1, shape=3, strides=5, dtype=wp.float32, device="cpu")
    with pytest.raises(BufferError, match="multiple of the element size"):
        a.__dlpack__()


def test_empty(device, producer):
    b = wp.from_dlpack(producer(wp.zeros((0, 3), dtype=float, device=device)))
    assert b.shape == (0, 3)


# The array lives until the last consumer is gone.
def test_consumer_keeps_array_alive(device, producer):
    a = wp.full(8, 3.0, dtype=float, device=device)
    gone = weakref.ref(a)
    b = wp.from_dlpack(producer(a))
    del a
    gc.collect()
    assert gone() is not None
    view = b[2:]
    del b
    gc.collect()
    assert view.list() == [3.0] * 6
    del view
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("version", [None, (1, 0)])
def test_capsule_that_nobody_takes(device, version):
    a = wp.zeros(8, dtype=float, device=device)
    gone = weakref.ref(a)
    capsule = a.__dlpack__(max_version=version)
    del a
    gc.collect()
    assert gone() is not None
    del capsule
    gc.collect()
    assert gone() is None


@pytest.mark.parametrize("version", [None, (1, 0)])
def test_capsule_is_for_one_use(device, version):
    a = wp.zeros(8, dtype=float, device=device)
    capsule = a.__dlpack__(max_version=version)
    assert "versioned" in repr(capsule) or version is None
    wp.from_dlpack(capsule)
    assert '"used_dltensor' in repr(capsule)
    with pytest.raises(ValueError, match="used already"):
        wp.from_dlpack(capsule)


# A refusal leaves the capsule usable.
def test_refused_capsule_stays_usable():
    capsule = wp.to_dlpack(wp.zeros((2, 3), dtype=float, device="cpu"))
    with pytest.raises(ValueError, match=r"inner dimensions \(2,\)"):
        wp.from_dlpack(capsule, dtype=wp.vec2)
    assert wp.from_dlpack(capsule, dtype=wp.vec3).shape == (2,)


def test_read_only():
    source = np.arange(3.0)
    source.flags.writeable = False
    a = wp.from_dlpack(source)
    assert a.read_only and a[1:].read_only
    assert not a.numpy().flags.writeable
    assert inspect(a, max_version=(1, 0))[2] == READ_ONLY
    for write in (lambda: a.fill_(1.0), a.zero_, lambda: a.assign([1.0, 2.0, 3.0])):
        with pytest.raises(ValueError, match="read-only"):
            write()
    with pytest.raises(BufferError, match="read-only"):
        wp.to_dlpack(a)
    assert not wp.clone(a).read_only


def test_copies(device):
    a = wp.array([1.0, 2.0], dtype=float, device=device)
    assert inspect(a, max_version=(1, 0))[2] == 0
    assert inspect(a, max_version=(1, 0), copy=True)[2] == COPIED
    assert inspect(a, max_version=(1, 0), copy=False)[2] == 0
    copied = wp.from_dlpack(a.__dlpack__(copy=True))
    assert copied.ptr != a.ptr
    assert copied.list() == [1.0, 2.0]


@pytest.mark.cuda
def test_to_other_device():
    a = wp.array([1.0, 2.0], dtype=float, device="cuda:0")
    b = wp.from_dlpack(a.__dlpack__(dl_device=(CPU, 0)))
    assert (str(b.device), b.list()) == ("cpu", [1.0, 2.0])
    c = wp.from_dlpack(b.__dlpack__(dl_device=(CUDA, 0)))
    assert (str(c.device), c.list()) == ("cuda:0", [1.0, 2.0])
    with pytest.raises(BufferError, match="needs a copy"):
        a.__dlpack__(dl_device=(CPU, 0), copy=False)


class Copying:
    """Tensors that convert to NumPy by a copy, as Paddle's do, and have DLPack."""

    def __init__(self, data):
        self.data = data

    def __array__(self, dtype=None, copy=None):
        return self.data.copy()

    def __dlpack__(self, **options):
        return self.data.__dlpack__(**options)

    def __dlpack_device__(self):
        return (1, 0)


@wp.kernel
def increase(x: wp.array(dtype=wp.vec2)):
    i = wp.tid()
    x[i] = x[i] + wp.vec2(1.0, 2.0)


def test_launches_write_to_the_memory_itself():
    """A kernel writes to what an argument lends by DLPack, not to what it converts to."""
    data = np.zeros((3, 2), np.float32)
    wp.launch(increase, 3, [Copying(data)], device="cpu")
    wp.launch(increase, 2, [Copying(data[1:])], device="cpu")
    assert data.tolist() == [[1.0, 2.0], [2.0, 4.0], [2.0, 4.0]]


def test_memory_of_other_devices_is_not_asked_for():
    """A producer on a device that cannot be used makes no capsule in vain."""

    class Elsewhere:
        def __dlpack_device__(self):
            return (7, 0)

        def __dlpack__(self, **options):
            raise AssertionError

    with pytest.raises(TypeError, match="DLPack device type 7"):
        wp.from_dlpack(Elsewhere())


def test_unknown_device():
    with pytest.raises(BufferError, match="device"):
        wp.zeros(2, device="cpu").__dlpack__(dl_device=(7, 0))


@pytest.mark.cuda
def test_consumer_stream_waits():
    @wp.kernel
    def slow(x: wp.array(dtype=float)):
        value = float(0.0)
        for _ in range(2000000):
            value = wp.sin(value + 1.0)
        x[wp.tid()] = value

    a = wp.zeros(4, dtype=float, device="cuda:0")
    consumer = wp.Stream("cuda:0")
    wp.launch(slow, dim=4, inputs=[a], device="cuda:0")
    a.__dlpack__(stream=-1)
    assert consumer.is_complete
    a.__dlpack__(stream=consumer.cuda_stream)
    assert not consumer.is_complete
    consumer.synchronize()
    for stream in (None, 1, 2):
        a.__dlpack__(stream=stream)
    with pytest.raises(ValueError, match="-1, 1, 2"):
        a.__dlpack__(stream=0)
    with pytest.raises(TypeError, match="int or None"):
        a.__dlpack__(stream="fast")


# The producer hears of the stream that will read.
def test_producer_is_told_the_stream(device):
    producer = Producer(wp.zeros(2, device=device))
    wp.from_dlpack(producer)
    expected = {} if device == "cpu" else {"stream": wp.get_stream(device).cuda_stream}
    assert producer.asked == {"max_version": (1, 0), **expected}


def test_structs_have_no_type():
    @wp.struct
    class Pair:
        a: float
        b: int

    with pytest.raises(BufferError, match="struct 'Pair'"):
        wp.zeros(2, dtype=Pair, device="cpu").__dlpack__()


@pytest.mark.parametrize(
    "source, dtype, message",
    [
        (np.zeros(3, np.complex64), None, "no scalar type"),
        (np.zeros((3, 2), np.float32), wp.vec3, r"inner dimensions \(3,\)"),
        (np.zeros((3, 6), np.float32)[:, ::2], wp.vec3, "packed inner dimensions"),
        (np.zeros(3, np.float32), wp.float64, "'float64'.*'float32'"),
        (np.zeros(3, np.int8), wp.bool, "'bool'.*'int8'"),
        (np.zeros((1,) * 5), None, "1 to 4 dimensions"),
        (np.zeros(4)[::-1], None, "strides of at least 0"),
        (object(), None, "DLPack.*but got 'object'"),
    ],
)
def test_refusals(source, dtype, message):
    with pytest.raises((TypeError, ValueError), match=message):
        wp.from_dlpack(source, dtype=dtype)


def test_kernels_write_through(device, producer):
    @wp.kernel
    def double(x: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        x[i] = x[i] * 2.0

    a = wp.ones((5, 3), dtype=float, device=device)
    b = wp.from_dlpack(producer(a), dtype=wp.vec3)
    wp.launch(double, dim=5, inputs=[b], device=device)
    np.testing.assert_array_equal(a.numpy(), np.full((5, 3), 2.0))


# Exchanged memory that is still in use when the interpreter ends.
def test_exit_with_tensors_in_use():
    code = """
import sys, numpy as np, warp as wp
kept = np.from_dlpack(wp.ones(10, device="cpu"))
borrowed = wp.from_dlpack(np.ones(10))
sys.modules["numpy"].kept_until_the_end = kept, borrowed, wp.to_dlpack(wp.ones(3, device="cpu"))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("Error")) == (0, 0), done.stderr


def test_what_cannot_be_exchanged_is_named(config):
    """Errors name both types, the device and the class of the given object."""
    config.peer_messages = True
    truth = wp.to_dlpack(wp.zeros(1, dtype=wp.bool, device="cpu"))
    with pytest.raises(TypeError, match="DLPack bool8 and Warp float32"):
        wp.from_dlpack(truth, dtype=wp.float32)

    class Source:
        place = (123, 7)

        def __dlpack_device__(self):
            return self.place

        def __dlpack__(self, **options):
            assert self.place[0] == 1, "only memory of known devices is asked for"
            return object()

    with pytest.raises(TypeError, match="device_type=123, device_id=7"):
        wp.from_dlpack(Source())
    Source.place = (1, 0)
    with pytest.raises(TypeError, match="expects a DLPack capsule, but got 'object'"):
        wp.from_dlpack(Source())
