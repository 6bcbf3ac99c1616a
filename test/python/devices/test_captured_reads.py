"""Reading an array on the CPU while a graph is captured that is going to write it."""

import numpy as np
import pytest

import warp as wp

N = 4


@wp.kernel
def increase(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] + 1.0


@wp.struct
class Pair:
    x: wp.array(dtype=float)
    y: wp.array(dtype=float)


@wp.kernel
def increase_pair(pair: Pair):
    i = wp.tid()
    pair.y[i] = pair.x[i] + 1.0


@wp.kernel
def increase_behind(pair: Pair, other: Pair, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = pair.x[i] + other.x[i]


def launch(x, y):
    wp.launch(increase, N, [x], [y], device="cpu")


def launch_struct(x, y):
    pair = Pair()
    pair.x, pair.y = x, y
    wp.launch(increase_pair, N, [pair], device="cpu")


def launch_behind(x, y):
    """Arrays that are written come after structs, whose arrays are only read."""
    pairs = [Pair(), Pair()]
    for pair in pairs:
        pair.x = pair.y = x
    wp.launch(increase_behind, N, [*pairs, y], device="cpu")


def launch_recorded(x, y):
    wp.launch(increase, N, [x, y], device="cpu", record_cmd=True).launch()


READS = {
    "numpy": lambda a: a.numpy(),
    "list": lambda a: a.list(),
    "interface": np.asarray,
    "part": lambda a: a[1:3].numpy(),
    "pointer": lambda a: a.cptr()[0],
    "text": str,
}


@pytest.mark.parametrize("read", READS.values(), ids=READS)
@pytest.mark.parametrize(
    "work",
    [
        *(launch, launch_struct, launch_behind, launch_recorded),
        lambda x, y: y.fill_(1.0),
        lambda x, y: wp.copy(y, x),
    ],
    ids=["launch", "struct", "behind", "recorded", "fill", "copy"],
)
def test_old_contents_are_not_given_out(work, read):
    """The array holds what it held before the capture until the graph is launched."""
    x, y = (wp.zeros(N, dtype=float, device="cpu") for _ in range(2))
    with wp.ScopedCapture(device="cpu") as capture:
        read(y)
        work(x, y)
        with pytest.raises(wp.WarpError, match=r"written by work.*captured.*capture_launch"):
            read(y)
    wp.capture_launch(capture.graph)
    read(y)


def test_what_the_graph_does_not_write_can_be_read():
    x, y, z = (wp.zeros(N, dtype=float, device="cpu") for _ in range(3))
    rows = wp.zeros((2, N), dtype=float, device="cpu")
    with wp.ScopedCapture(device="cpu") as capture:
        launch(x, y)
        launch(x, rows[1])
        made = wp.array([1.0, 2.0], dtype=float, device="cpu")
        for one in (x, z, rows[0], made):
            one.numpy()
    wp.capture_launch(capture.graph)
    assert y.list() == [1.0] * N and rows.numpy().tolist() == [[0.0] * N, [1.0] * N]


def test_an_aborted_capture_leaves_nothing_behind():
    y = wp.zeros(N, dtype=float, device="cpu")
    with pytest.raises(KeyError):
        with wp.ScopedCapture(device="cpu"):
            y.fill_(1.0)
            raise KeyError
    assert y.list() == [0.0] * N
