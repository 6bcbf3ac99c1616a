"""A child that was forked while another thread makes geometry uses geometry."""

import os
import signal
import threading

import numpy as np
import pytest

import warp as wp


@wp.kernel
def ask(mesh: wp.uint64, out: wp.array(dtype=float)):
    out[0] = float(wp.mesh_query_point_no_sign(mesh, wp.vec3(0.1), 10.0).face)


def triangles():
    points = np.random.default_rng(0).random((90, 3)).astype(np.float32)
    corners = wp.array(np.arange(90), dtype=int, device="cpu")
    return wp.Mesh(wp.array(points, dtype=wp.vec3, device="cpu"), corners)


def boxes():
    low = wp.array(np.random.default_rng(1).random((50, 3)), dtype=wp.vec3, device="cpu")
    return wp.Bvh(low, low)


def grid():
    made = wp.HashGrid(4, 4, 4, device="cpu")
    made.build(wp.zeros(20, dtype=wp.vec3, device="cpu"), 1.0)
    return made


def volume():
    return wp.Volume.load_from_numpy(np.zeros((8, 8, 8), np.float32), device="cpu")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks are those of POSIX")
@pytest.mark.parametrize("make", [triangles, boxes, grid, volume])
def test_fork_while_a_thread_makes_it(make):
    """The child makes, refits, frees and searches; an alarm ends one that hangs."""
    mesh, out, stop = triangles(), wp.zeros(1, dtype=float, device="cpu"), threading.Event()
    wp.launch(ask, 1, inputs=[mesh.id, out], device="cpu")

    def spin():
        while not stop.is_set():
            make()

    thread = threading.Thread(target=spin)
    thread.start()
    try:
        for _ in range(40):
            child = os.fork()
            if not child:
                signal.alarm(20)
                wp.launch(ask, 1, inputs=[mesh.id, out], device="cpu")
                mesh.refit()
                make()
                os._exit(0)
            assert os.waitpid(child, 0)[1] == 0
    finally:
        stop.set()
        thread.join()
