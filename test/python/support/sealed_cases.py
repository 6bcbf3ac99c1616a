"""A program that loads changed files whose checksums fit; `test_sealed_files.py` runs it.

sealed_cases.py KIND FOLDER SEED...

It prints each seed before the case and what is wrong with it; where it crashes, the last line says.
"""

import os
import random
import struct
import sys

import numpy as np

sys.path.insert(0, os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

from support.sealed_files import damaged, hash_bytes, resealed

import warp as wp
from warp import _native, saved

CPU = "cpu"


@wp.struct
class State:
    x: wp.array(dtype=float)
    k: int


@wp.kernel
def scale(x: wp.array(dtype=float), s: float):
    i = wp.tid()
    x[i] = x[i] * s + 1.0


@wp.kernel
def move(p: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), n: wp.array(dtype=int), dt: float):
    i = wp.tid()
    p[i] = p[i] + v[i] * dt
    wp.atomic_add(n, i % 3, 1)


@wp.kernel
def step(s: State, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = s.x[i] * float(s.k)


@wp.kernel
def near(mesh: wp.uint64, p: wp.array(dtype=wp.vec3), d: wp.array(dtype=float)):
    i = wp.tid()
    q = wp.mesh_query_point_no_sign(mesh, p[i], 100.0)
    d[i] = wp.length(wp.mesh_eval_position(mesh, q.face, q.u, q.v) - p[i])


def make_module(folder):
    module = sys.modules[__name__]
    paths = wp.compile_aot_module(module, device=CPU, module_dir=folder, strip_hash=True)
    paths += wp.compile_aot_module(module, arch=[80], module_dir=folder, strip_hash=True)
    return [open(path, "rb").read() for path in paths]


def make_graph(folder):
    rng = np.random.RandomState(0)
    x, y = wp.array(rng.rand(50), dtype=float, device=CPU), wp.zeros(50, dtype=float, device=CPU)
    p, v = (wp.array(rng.rand(20, 3), dtype=wp.vec3, device=CPU) for _ in range(2))
    n, left = wp.zeros(3, dtype=int, device=CPU), wp.full(1, 3, dtype=int, device=CPU)
    s = State()
    s.x, s.k = x, 3
    points = wp.array(rng.rand(9, 3), dtype=wp.vec3, device=CPU)
    mesh = wp.Mesh(points, wp.array(np.arange(9), dtype=int, device=CPU))
    bvh = wp.Bvh(wp.clone(p), wp.array(p.numpy() + 0.1, dtype=wp.vec3, device=CPU))
    grid = wp.HashGrid(4, 4, 4, device=CPU)
    grid.build(p, 0.5)
    keys = wp.array(np.arange(20)[::-1].copy(), dtype=int, device=CPU)
    values, d = wp.clone(keys), wp.zeros(20, dtype=float, device=CPU)
    with wp.ScopedCapture(device=CPU, apic=True) as capture:
        wp.launch(scale, 50, [x, 2.0], device=CPU)
        wp.launch(move, 20, [p, v, n, 0.1], device=CPU)
        wp.launch(step, 50, [s, y], device=CPU)
        y[:10].fill_(3.0)
        y[::2].fill_(4.0)
        wp.copy(x, y, count=20)
        wp.copy(x[::2], y[::2])
        mesh.refit()
        bvh.refit()
        bvh.rebuild()
        grid.build(p, 0.5)
        wp.launch(near, 20, [mesh.id, p, d], device=CPU)
        wp.utils.array_scan(n, n, inclusive=True)
        wp.utils.radix_sort_pairs(keys, values, 10)
        wp.capture_while(left, lambda: left.fill_(0))
    path = os.path.join(folder, "g.wrp")
    wp.capture_save(capture.graph, path, inputs={"x": x, "p": p}, outputs={"y": y, "d": d})
    (name,) = os.listdir(os.path.join(folder, "g_modules"))
    code = open(os.path.join(folder, "g_modules", name), "rb").read()
    return open(path, "rb").read(), name, code


def is_clear(error) -> bool:
    """True if it is an error of the package that says what is wrong with which file."""
    text = str(error)
    named = ("saved graph '", "saved module '", "its saved code", "is damaged", "lacks")
    return isinstance(error, (wp.WarpError, ValueError)) and any(one in text for one in named)


def module_case(files, choose, folder):
    changed = resealed(damaged(choose, choose.choice(files), files))
    path = os.path.join(folder, "changed.warp")
    with open(path, "wb") as file:
        file.write(changed)
    module = _native.SavedModule(path)
    _ = module.kernels, module.codes, module.name
    saved.read(path)
    module.attach(scale.prepare(), "scale")


def graph_case(files, choose, folder):
    graph, name, code = files
    if choose.random() < 0.7:
        graph = resealed(damaged(choose, graph))
    else:
        # The graph has the hash of the whole file.
        old, code = hash_bytes(code), resealed(damaged(choose, code))
        graph = graph.replace(struct.pack("<Q", old), struct.pack("<Q", hash_bytes(code)))
        graph = resealed(graph)
    wp.capture_load_from_bytes(graph, {name: code}, device=CPU, memory_limit=1 << 30)


def make_cache(folder):
    """Code of the kernel cache, whose key is the name of its file."""
    wp.launch(scale, 3, [wp.zeros(3, dtype=float, device=CPU), 1.0], device=CPU)
    _native.wait_for_background()
    found = []
    for root, _, names in os.walk(wp.config.kernel_cache_dir):
        found += [os.path.join(root, name) for name in names if name.endswith((".code", ".kernel"))]
    return [open(path, "rb").read() for path in sorted(found)]


def cache_case(files, choose, folder):
    changed = resealed(damaged(choose, choose.choice(files), files))
    _native.read_cached(changed)


KINDS = {
    "module": (make_module, module_case),
    "graph": (make_graph, graph_case),
    "cache": (make_cache, cache_case),
}


def main(kind, folder, *seeds):
    make, case = KINDS[kind]
    files = make(folder)
    for one in files:
        if isinstance(one, bytes):
            assert resealed(one) == one, "the checksum is another one"
    for seed in seeds:
        print("seed", seed, flush=True)
        try:
            case(files, random.Random(int(seed)), folder)
        except Exception as error:
            if not is_clear(error):
                print("unclear:", type(error).__name__, str(error)[:300], flush=True)
                return 1
    print("done", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
