"""MPI by mpi4py: arrays as buffers, and what cannot be right is an error."""

import numpy as np
import pytest

import warp as wp

MPI = pytest.importorskip("mpi4py.MPI")

COMM = MPI.COMM_SELF
SCALARS = [
    *(wp.bool, wp.int8, wp.int16, wp.int32, wp.int64, wp.uint8, wp.uint16, wp.uint32, wp.uint64),
    *(wp.float32, wp.float64),
]


def send(a, b):
    COMM.Sendrecv(a, 0, 0, b, 0, 0)


@pytest.mark.parametrize("scalar", SCALARS, ids=lambda one: one.__name__)
def test_arrays_are_buffers(scalar):
    a = wp.array(np.arange(8) % 2, dtype=scalar, device="cpu")
    b = wp.zeros(8, dtype=scalar, device="cpu")
    send(a, b)
    assert np.array_equal(a.numpy(), b.numpy())


def test_composites_and_rows():
    a = wp.array(np.arange(12.0).reshape(2, 2, 3), dtype=wp.vec3, device="cpu")
    b = wp.zeros((3, 2), dtype=wp.vec3, device="cpu")
    send(a[1], b[2])
    assert np.array_equal(b.numpy()[2], a.numpy()[1])
    total = wp.zeros(2, dtype=wp.vec3, device="cpu")
    COMM.Allreduce(a[0], total, MPI.SUM)
    assert np.array_equal(total.numpy(), a.numpy()[0])


@pytest.mark.parametrize("dtype", [wp.bfloat16, wp.types.vector(3, wp.bfloat16)])
def test_bfloat16_is_not_taken_for_bytes(dtype):
    """MPI has no such type and would add bytes; as integers the bits can be sent."""
    a, b = (wp.zeros(4, dtype=dtype, device="cpu") for _ in range(2))
    for call in (
        lambda: COMM.Allreduce(MPI.IN_PLACE, a, MPI.SUM),
        lambda: COMM.Reduce(a, b, MPI.MAX),
        lambda: send(a, b),
    ):
        with pytest.raises(BufferError, match=r"'bfloat16' for bytes.*float32.*view"):
            call()


def test_bits_of_bfloat16_can_be_sent():
    a = wp.array([1.5, -2.0], dtype=wp.bfloat16, device="cpu")
    b = wp.zeros(2, dtype=wp.bfloat16, device="cpu")
    send(a.view(wp.uint16), b.view(wp.uint16))
    assert b.list() == [1.5, -2.0]


def test_other_libraries_get_bfloat16():
    torch = pytest.importorskip("torch")
    a = wp.array([1.5, -2.0], dtype=wp.bfloat16, device="cpu")
    assert torch.from_dlpack(a).tolist() == torch.from_dlpack(a, copy=False).tolist() == [1.5, -2.0]
    assert wp.from_dlpack(a).list() == [1.5, -2.0]


@pytest.mark.parametrize(
    "array, message",
    [
        (lambda: wp.zeros((4, 4), dtype=float, device="cpu")[:, 1], "not contiguous"),
        (lambda: wp.zeros(4, dtype=wp.types.matrix((2, 2), wp.bfloat16), device="cpu"), "bytes"),
    ],
)
def test_what_mpi_cannot_take_is_an_error(array, message):
    with pytest.raises(BufferError, match=message):
        send(array(), array())


@wp.struct
class Particle:
    x: wp.vec3
    m: float


def test_structs_go_as_bytes():
    a = wp.zeros(2, dtype=Particle, device="cpu")
    a.numpy()["m"] = [1.0, 2.0]
    b = wp.zeros_like(a)
    send([a.numpy(), MPI.BYTE], [b.numpy(), MPI.BYTE])
    assert b.numpy()["m"].tolist() == [1.0, 2.0]
    with pytest.raises(BufferError, match="struct 'Particle'"):
        send(a, b)


def test_nothing_is_sent_while_a_graph_is_captured():
    """A message would go now, and not when the graph is launched."""
    a, b = (wp.zeros(4, dtype=float, device="cpu") for _ in range(2))
    with wp.ScopedCapture(device="cpu") as capture:
        with pytest.raises(wp.WarpError, match="MPI cannot be captured"):
            send(a, b)
        a.fill_(2.0)
        with pytest.raises(wp.WarpError, match="captured"):
            send(a.numpy(), b.numpy())
    wp.capture_launch(capture.graph)
    send(a, b)
    assert b.list() == [2.0] * 4


def test_memory_that_ranks_share():
    window = MPI.Win.Allocate_shared(16, 4, comm=COMM)
    memory, _ = window.Shared_query(0)
    shared = np.ndarray(4, np.float32, memory)
    wp.array(shared, copy=False, device="cpu").fill_(3.0)
    assert shared.tolist() == [3.0] * 4
    window.Free()
