"""Ids of geometry in saved graphs: the numbers that kernels use so, whatever values others have.

A loaded graph has geometry of its own, with ids of its own, while the one that was saved lives on.
A number that is no id is the same in both, even if it has the value of an id.
"""

import gc

import numpy as np
import pytest

import warp as wp

HEIGHTS = (1.0, 2.0, 4.0)


@wp.struct
class Entry:
    seed: wp.uint64
    mesh: wp.uint64
    pair: wp.vec2i


@wp.struct
class Scene:
    seed: wp.uint64
    entry: Entry
    entries: wp.array(dtype=Entry)


@wp.func
def height(mesh: wp.uint64):
    """How high the plane of a mesh lies above the origin."""
    found = wp.mesh_query_point_no_sign(mesh, wp.vec3(0.0, 0.0, 0.0), 1.0e3)
    return wp.mesh_eval_position(mesh, found.face, found.u, found.v)[2]


@wp.kernel
def number_beside_id(
    mesh: wp.uint64,
    seed: wp.uint64,
    signed: wp.int64,
    pair: wp.vec2i,
    real: wp.float64,
    seeds: wp.array(dtype=wp.uint64),
    out: wp.array(dtype=float),
    numbers: wp.array(dtype=wp.uint64),
):
    out[0] = height(mesh)
    numbers[0] = seed
    numbers[1] = wp.uint64(signed)
    numbers[2] = wp.uint64(pair[1]) << wp.uint64(32) | wp.uint64(wp.uint32(pair[0]))
    numbers[3] = wp.cast(real, wp.uint64)
    numbers[4] = seeds[0]
    numbers[5] = seeds[1] + seed


@wp.kernel
def fields(scene: Scene, out: wp.array(dtype=float), numbers: wp.array(dtype=wp.uint64)):
    entry = scene.entries[1]
    out[0] = height(scene.entry.mesh)
    out[1] = height(entry.mesh)
    numbers[0] = scene.seed
    numbers[1] = scene.entry.seed
    numbers[2] = scene.entries[0].seed
    numbers[3] = entry.seed
    numbers[4] = wp.uint64(wp.uint32(entry.pair[0]))


@wp.kernel
def use(ids: wp.array(dtype=wp.uint64), out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = height(ids[i])


@wp.kernel
def store(first: wp.uint64, second: wp.uint64, ids: wp.array(dtype=wp.uint64)):
    ids[0] = first
    ids[1] = wp.where(ids[2] > wp.uint64(0), second, first)


@wp.kernel
def chosen_in_loops(
    first: wp.uint64,
    second: wp.uint64,
    seed: wp.uint64,
    steps: int,
    out: wp.array(dtype=float),
    numbers: wp.array(dtype=wp.uint64),
):
    mesh = first
    other = second
    random = seed
    step = int(0)
    while step < steps:
        if step % 2 == 0:
            mesh, other = other, mesh
        random = random * wp.uint64(3) + wp.uint64(1)
        step += 1
    for _k in range(steps):
        mesh, other = other, mesh
    out[0] = height(mesh)
    numbers[0] = random


@wp.kernel
def pick(entries: wp.array2d(dtype=Entry), ids: wp.array(dtype=wp.uint64)):
    i = wp.tid()
    ids[i] = entries[i, 1].mesh


def plane(z, device):
    points = [(-9, -9, z), (9, -9, z), (0, 9, z)]
    points = wp.array(points, dtype=wp.vec3, device=device)
    return wp.Mesh(points, wp.array([0, 1, 2], dtype=int, device=device))


class Saved:
    """Captures `work`, loads it while the saved meshes live, and once they are gone."""

    def __init__(self, device, path, **outputs):
        self.device, self.path, self.outputs = device, str(path / "graph"), outputs

    def check(self, capture, expected, runs=1):
        wp.capture_save(capture.graph, self.path, outputs=self.outputs)
        graph = wp.capture_load(self.path, device=self.device)
        for _ in range(runs):
            wp.capture_launch(graph)
        for name, values in expected.items():
            found = wp.empty_like(self.outputs[name])
            graph.get_param(name, found)
            found = found.numpy()[: len(values)]
            if name == "numbers":
                assert found.tolist() == values
            else:
                np.testing.assert_allclose(found, values, rtol=1e-6)


def numbers_of(count, device):
    return wp.zeros(count, dtype=wp.uint64, device=device)


def halves(number):
    low, high = number & 0xFFFFFFFF, number >> 32
    return wp.vec2i(low - (low >> 31 << 32), high - (high >> 31 << 32))


def test_arguments_with_the_value_of_an_id(device, tmp_path):
    mesh = plane(HEIGHTS[0], device)
    id = mesh.id
    seeds = wp.array([id, id], dtype=wp.uint64, device=device)
    out, numbers = wp.zeros(1, device=device), numbers_of(6, device)
    real = float(np.array(id, np.uint64).view(np.float64))
    arguments = [mesh.id, id, id, halves(id), real, seeds, out, numbers]
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(number_beside_id, 1, arguments, device=device)
    saved = Saved(device, tmp_path, out=out, numbers=numbers, seeds=seeds)
    wp.capture_launch(capture.graph)
    expected = [id, id, id, id, id, 2 * id]
    assert numbers.numpy().tolist() == expected
    saved.check(capture, {"out": HEIGHTS[:1], "numbers": expected})


def test_fields_with_the_value_of_an_id(device, tmp_path):
    meshes = [plane(z, device) for z in HEIGHTS]
    ids = [mesh.id for mesh in meshes]

    def entry(mesh):
        made = Entry()
        made.seed, made.mesh, made.pair = ids[2], ids[mesh], halves(ids[2])
        return made

    scene = Scene()
    scene.seed, scene.entry = ids[0], entry(0)
    scene.entries = wp.array([entry(2), entry(1)], dtype=Entry, device=device)
    out, numbers = wp.zeros(2, device=device), numbers_of(5, device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(fields, 1, [scene, out, numbers], device=device)
    saved = Saved(device, tmp_path, out=out, numbers=numbers)
    expected = [ids[0], ids[2], ids[2], ids[2], ids[2] & 0xFFFFFFFF]
    saved.check(capture, {"out": HEIGHTS[:2], "numbers": expected})


@pytest.mark.parametrize("steps", [0, 1, 4])
def test_ids_go_through_loops(device, tmp_path, steps):
    meshes = [plane(z, device) for z in HEIGHTS]
    seed = meshes[2].id
    out, numbers = wp.zeros(1, device=device), numbers_of(1, device)
    arguments = [meshes[0].id, meshes[1].id, seed, steps, out, numbers]
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(chosen_in_loops, 1, arguments, device=device)
    swaps = (steps + 1) // 2 + steps
    for _ in range(steps):
        seed = (3 * seed + 1) % 2**64
    saved = Saved(device, tmp_path, out=out, numbers=numbers)
    saved.check(capture, {"out": [HEIGHTS[swaps % 2]], "numbers": [seed]})


@pytest.mark.parametrize("way", ["stores", "copies", "gaps", "fills", "uploads", "fields"])
def test_ids_that_the_graph_writes(device, tmp_path, way):
    meshes = [plane(z, device) for z in HEIGHTS]
    ids = np.array([mesh.id for mesh in meshes], np.uint64)
    given = wp.array(ids, device=device)
    used, out = numbers_of(3, device), wp.zeros(3, device=device)
    expected = list(HEIGHTS)
    wide = wp.array(np.repeat(ids, 2), device=device)
    entries = np.zeros((3, 2), Entry.numpy_dtype())
    entries["mesh"][:, 1], entries["seed"] = ids, ids[0]
    entries = wp.array(entries, dtype=Entry, device=device)
    if way == "stores":
        used.assign(given)
        expected = [HEIGHTS[1], HEIGHTS[2], HEIGHTS[2]]
    with wp.ScopedCapture(device, apic=True) as capture:
        if way == "stores":
            wp.launch(store, 1, [meshes[1].id, meshes[2].id, used], device=device)
        elif way == "copies":
            wp.copy(used, given)
        elif way == "gaps":
            wp.copy(used, wide[1::2])
        elif way == "fills":
            used.fill_(meshes[2].id)
            expected = [HEIGHTS[2]] * 3
        elif way == "uploads":
            wp.copy(used, wp.array(ids, device="cpu"))
        else:
            wp.launch(pick, 3, [entries, used], device=device)
        wp.launch(use, 3, [used, out], device=device)
    Saved(device, tmp_path, out=out).check(capture, {"out": expected})
    # The loaded graph needs nothing of what was saved.
    del meshes, capture
    gc.collect()
    graph = wp.capture_load(str(tmp_path / "graph"), device=device)
    wp.capture_launch(graph)
    found = wp.empty_like(out)
    graph.get_param("out", found)
    np.testing.assert_allclose(found.numpy(), expected, rtol=1e-6)


def test_arrays_that_no_kernel_takes_ids_from(device, tmp_path):
    mesh = plane(HEIGHTS[0], device)
    used, numbers = numbers_of(3, device), numbers_of(3, device)
    with wp.ScopedCapture(device, apic=True) as capture:
        numbers.fill_(mesh.id)
        wp.copy(used, numbers)
    Saved(device, tmp_path, numbers=used).check(capture, {"numbers": [mesh.id] * 3})


@wp.kernel
def to_plane(
    mesh: wp.uint64, x: wp.array(dtype=wp.vec3), seed: wp.uint64, out: wp.array(dtype=float)
):
    i = wp.tid()
    found = wp.mesh_query_point_no_sign(mesh, x[i], 1.0e3)
    at = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
    out[i] = wp.length_sq(at - x[i]) + float(seed % wp.uint64(7))


def test_ids_of_adjoints(device, tmp_path):
    mesh = plane(HEIGHTS[1], device)
    x = wp.array([[0.0, 0.0, 0.5]], dtype=wp.vec3, requires_grad=True, device=device)
    out = wp.zeros(1, requires_grad=True, device=device)
    tape = wp.Tape()
    with tape:
        wp.launch(to_plane, 1, [mesh.id, x, mesh.id, out], device=device)
    seed = wp.ones(1, device=device)
    tape.backward(grads={out: seed})
    tape.zero()
    with wp.ScopedCapture(device, apic=True) as capture:
        with wp.Tape() as tape:
            wp.launch(to_plane, 1, [mesh.id, x, mesh.id, out], device=device)
        tape.backward(grads={out: seed})
    saved = Saved(device, tmp_path, out=out, gradient=x.grad)
    away = 0.5 - HEIGHTS[1]
    expected = {"out": [away**2 + mesh.id % 7], "gradient": [[0.0, 0.0, 2 * away]]}
    saved.check(capture, expected)
