"""Forks at random moments while other threads make modules, arrays, graphs, meshes and load files:
a child works, so it never waits for a lock that a thread of its parent had."""

import subprocess
import sys

import pytest
from support.random_runs import seeds

PROGRAM = """
import os, random, signal, sys, tempfile, threading, time
import numpy as np
import warp as wp

wp.config.quiet = True
CPU = "cpu"

@wp.kernel
def scale(x: wp.array(dtype=float), s: float):
    i = wp.tid()
    x[i] = x[i] * s

@wp.kernel
def first(x: wp.array(dtype=float)):
    x[wp.tid()] = 1.0

points = wp.array(np.random.RandomState(0).rand(30, 3), dtype=wp.vec3, device=CPU)
faces = wp.array(np.arange(30), dtype=int, device=CPU)
x = wp.ones(30, dtype=float, device=CPU)
with wp.ScopedCapture(device=CPU, apic=True) as saved:
    wp.launch(scale, 30, [x, 2.0], device=CPU)
folder = tempfile.mkdtemp()
path = os.path.join(folder, "g.wrp")
wp.capture_save(saved.graph, path, outputs={"x": x})

def load():
    wp.capture_load(path, device=CPU)

def graph():
    with wp.ScopedCapture(device=CPU) as c:
        wp.launch(scale, 30, [x, 1.0], device=CPU)
    wp.capture_launch(c.graph)

def arrays():
    with wp.ScopedMemoryTracker(print=False):
        a = wp.zeros(10, dtype=float, device=CPU, requires_grad=True)
        a.grad.fill_(1.0)

def mesh():
    wp.Mesh(points, faces)

def module():
    @wp.kernel(module="unique")
    def made(x: wp.array(dtype=float), s: float):
        x[wp.tid()] = s
    made.unique_key = None
    wp.launch(made, 3, [x, 1.0], device=CPU)

def save():
    wp.capture_save(saved.graph, os.path.join(folder, "h.wrp"), outputs={"x": x})

def child():
    signal.alarm(20)
    a = wp.zeros(30, dtype=float, device=CPU)
    wp.launch(first, 30, [a], device=CPU)
    load(); graph(); arrays(); mesh()
    os._exit(0 if (a.numpy() == 1.0).all() else 1)

def again(work):
    while not stop:
        work()

work, seed = globals()[sys.argv[1]], int(sys.argv[2])
choose = random.Random(seed)
work()
stop, bad = False, 0
threads = [threading.Thread(target=again, args=(work,)) for _ in range(2)]
for one in threads:
    one.start()
for _ in range(10):
    time.sleep(choose.random() * 0.01)
    pid = os.fork()
    if not pid:
        child()
    bad += os.waitpid(pid, 0)[1] != 0
stop = True
for one in threads:
    one.join()
print("bad", bad)
"""


@pytest.mark.parametrize("seed", seeds(1))
@pytest.mark.parametrize("work", ["load", "graph", "arrays", "mesh", "module", "save"])
def test_children_work(work, seed, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    made = subprocess.run(
        [sys.executable, str(program), work, str(seed)], capture_output=True, text=True, timeout=120
    )
    assert (made.returncode, made.stdout.strip()) == (0, "bad 0"), made.stderr
