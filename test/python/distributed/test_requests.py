"""Requests that the runtime starts and tests, over functions that stand for those of MPI."""

import ctypes
import types
from array import array

import pytest

from warp import _native
from warp._src.distributed import failures

START = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_int, ctypes.c_void_p)
TEST = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int), ctypes.c_void_p
)


class Library:
    """`MPI_Startall` and `MPI_Testall`: requests end at the look of a number; both may fail."""

    def __init__(self, ends_at=1, start_error=0, test_error=0):
        self.looks, self.seen = 0, []

        def start(count, handles):
            self.seen.append((count, ctypes.string_at(handles, 4 * count)))
            return start_error

        def test(count, handles, flag, statuses):
            self.looks += 1
            # As many statuses as requests, of the largest size that a library has.
            ctypes.memset(statuses, 0xFF, 40 * count)
            flag[0] = self.looks >= ends_at
            return test_error

        self.functions = START(start), TEST(test)

    def requests(self, looks):
        addresses = [ctypes.cast(one, ctypes.c_void_p).value for one in self.functions]
        return _native.Requests(*addresses, bytes(range(12)), 3, looks)


def test_starts_and_looks_until_the_end():
    library = Library(ends_at=4)
    made = library.requests(3)
    assert made.run() == -1 and library.looks == 3
    assert made.wait() == 0 and library.looks == 4
    # Handles of four bytes, one behind the other.
    assert library.seen == [(3, bytes(range(12)))]


def test_errors_of_mpi_come_back():
    failed = Library(start_error=17)
    assert failed.requests(5).start() == 17
    assert failed.requests(5).run() == 17 and failed.looks == 0
    failed = Library(ends_at=9, test_error=18)
    assert failed.requests(5).run() == 18 and failed.looks == 1


def test_run_counts_steps_and_notes_them():
    made = Library().requests(1)
    plan, log = array("q", [7, 41]), array("q", [0, 0, 0])
    made.note(plan.buffer_info()[0], log.buffer_info()[0] + 8)
    assert made.start() == 0 and log.tolist() == [0, 0, 0]
    assert made.run() == 0 and plan.tolist() == [7, 42] and log.tolist() == [0, 7, 42]


def test_errors_and_late_ranks_go_on_in_python():
    mpi = pytest.importorskip("warp._src.distributed.mpi", exc_type=ImportError)
    waited = []
    comm = types.SimpleNamespace(
        failed=lambda what, text: failures.DistributedError(f"rank 0: {what}: {text}"),
        wait=lambda *rest: waited.append(rest),
    )
    work = types.SimpleNamespace(comm=comm, what="halo", requests=[1], peers=[1])
    mpi.Persistent.settle(work, 0)
    assert not waited
    mpi.Persistent.settle(work, -1)
    assert waited == [([1], "halo", [1])]
    with pytest.raises(failures.DistributedError, match="rank 0: halo: MPI says 'MPI_ERR_TAG"):
        mpi.Persistent.settle(work, 4)
