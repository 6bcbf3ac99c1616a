"""Graphs in files: what is saved, loaded elsewhere, bound by name and refused."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warp as wp


@wp.struct
class Pair:
    values: wp.array(dtype=wp.vec3)
    scale: float


@wp.kernel
def scale(x: wp.array(dtype=float), y: wp.array(dtype=float), s: float):
    i = wp.tid()
    y[i] = x[i] * s


@wp.kernel
def scale_pair(p: Pair, out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    out[i] = p.values[i] * p.scale


@wp.kernel
def step(x: wp.array(dtype=float), left: wp.array(dtype=int)):
    x[0] = 0.5 * x[0]
    left[0] = left[0] - 1


@wp.kernel
def gather(x: wp.indexedarray(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] + 1.0


@wp.kernel
def total(x: wp.array2d(dtype=float), sums: wp.array(dtype=float)):
    i, j = wp.tid()
    wp.atomic_add(sums, i, x[i, j])


@wp.kernel(module_options={"deterministic": True}, module="unique")
def total_exactly(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    wp.atomic_add(out, 0, x[wp.tid()])


def reloaded(tmp_path, device, capture, inputs=None, outputs=None):
    path = str(tmp_path / "graph")
    wp.capture_save(capture.graph, path, inputs=inputs, outputs=outputs)
    return wp.capture_load(path, device=device)


def result(graph, name, like):
    out = wp.empty_like(like)
    graph.get_param(name, out)
    return out.numpy()


def test_inputs_and_outputs_by_name(device, tmp_path):
    x = wp.array(np.arange(64.0), dtype=float, device=device)
    y = wp.zeros(64, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale, 64, [x, y, 3.0], device=device)
    assert capture.graph.apic and not capture.graph.is_loaded
    graph = reloaded(tmp_path, device, capture, {"x": x}, {"y": y})
    assert graph.is_loaded and not graph.apic
    assert graph.params == {"x": {"size": 256}, "y": {"size": 256}}
    # Contents are saved, too.
    wp.capture_launch(graph)
    assert (result(graph, "y", y) == 3.0 * np.arange(64)).all()
    graph.set_param("x", wp.full(64, 7.0, device=device))
    wp.capture_launch(graph)
    assert (result(graph, "y", y) == 21.0).all()
    assert not y.numpy().any(), "the captured arrays are others"
    assert graph.get_param_ptr("x") not in (None, x.ptr)
    assert graph.get_param_ptr("none") is None


def test_copies_fills_and_views(device, tmp_path):
    x = wp.array(np.arange(12.0).reshape(3, 4), dtype=float, device=device)
    y = wp.zeros((3, 4), device=device)
    v = wp.zeros(5, dtype=wp.vec3, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.copy(y, x)
        wp.copy(x[:, 1], y[:, 0])
        y[1:, 2:].fill_(9.0)
        v.fill_(wp.vec3(1.0, 2.0, 3.0))
        x[2].zero_()
    named = {"x": x, "y": y, "v": v}
    graph = reloaded(tmp_path, device, capture, outputs=named)
    wp.capture_launch(graph)
    wp.capture_launch(capture.graph)
    for name, value in named.items():
        assert (result(graph, name, value) == value.numpy()).all(), name


def test_arrays_that_share_memory_still_do(device, tmp_path):
    x = wp.array(np.arange(10.0), dtype=float, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale, 5, [x[:5], x[5:], 2.0], device=device)
        wp.launch(scale, 8, [x[2:], x[2:], 10.0], device=device)
    graph = reloaded(tmp_path, device, capture, {"all": x, "same": x})
    wp.capture_launch(graph)
    expected = np.array([0, 1, 20, 30, 40, 0, 20, 40, 60, 80.0])
    assert (result(graph, "all", x) == expected).all()
    assert graph.get_param_ptr("all") == graph.get_param_ptr("same")


def test_structs_indexed_arrays_and_several_variants(device, tmp_path):
    p = Pair()
    p.values = wp.array(np.arange(30.0).reshape(10, 3), dtype=wp.vec3, device=device)
    p.scale = 2.0
    out = wp.zeros(10, dtype=wp.vec3, device=device)
    x = wp.array(np.arange(20.0), dtype=float, device=device)
    chosen = wp.array([3, 1, 19], dtype=int, device=device)
    y = wp.zeros(20, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale_pair, 10, [p, out], device=device)
        wp.launch(gather, 3, [wp.indexedarray(x, [chosen]), y], device=device)
        wp.launch(scale, 5, [x[::4], y[10::2], 2.0], device=device)
        wp.launch(scale, 2, [x, y[18:], 1.0], device=device)
    p.scale = 100.0
    graph = reloaded(tmp_path, device, capture, outputs={"out": out, "y": y})
    wp.capture_launch(graph)
    assert (result(graph, "out", out) == 2.0 * np.arange(30.0).reshape(10, 3)).all()
    expected = np.zeros(20)
    expected[:3] = 4, 2, 20
    expected[10::2] = 0, 8, 16, 24, 32
    expected[18:] = 0, 1
    assert (result(graph, "y", y) == expected).all()


def test_loops_branches_and_graphs_in_graphs(device, tmp_path):
    x, left = wp.full(1, 64.0, device=device), wp.zeros(1, dtype=int, device=device)
    flag, y = wp.zeros(1, dtype=int, device=device), wp.zeros(1, device=device)
    if wp.get_device(device).is_cuda and not wp.is_conditional_graph_supported():
        pytest.skip("the driver has no conditional nodes")
    with wp.ScopedCapture(device, apic=True) as inner:
        left.fill_(2)
        wp.capture_while(left, lambda: wp.launch(step, 1, [x, left], device=device))
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.capture_launch(inner.graph)
        wp.capture_launch(inner.graph)
        wp.capture_if(flag, lambda: y.fill_(1.0), lambda: y.fill_(2.0))
    named = {"x": x, "y": y, "flag": flag}
    graph = reloaded(tmp_path, device, capture, outputs=named)
    wp.capture_launch(graph)
    assert result(graph, "x", x) == 4.0 and result(graph, "y", y) == 2.0
    graph.set_param("flag", wp.ones(1, dtype=int, device=device))
    wp.capture_launch(graph)
    assert result(graph, "x", x) == 0.25 and result(graph, "y", y) == 1.0
    # A graph without notes cannot be part of one that is saved.
    with wp.ScopedCapture(device) as plain:
        y.fill_(3.0)
    with wp.ScopedCapture(device, apic=True) as outer:
        wp.capture_launch(plain.graph)
    with pytest.raises(wp.WarpError, match="captured without `apic=True`, which no file holds"):
        wp.capture_save(outer.graph, tmp_path / "outer")


def test_libraries_and_arrays_born_inside(device, tmp_path):
    rng = np.random.default_rng(1)
    numbers = rng.integers(0, 50, 3000).astype(np.int32)
    keys = wp.array(np.concatenate([numbers, numbers * 0]), dtype=int, device=device)
    values = wp.array(np.arange(6000), dtype=int, device=device)
    sums = wp.zeros(3000, dtype=int, device=device)
    rows, ends = rng.random((7, 90), np.float32), wp.zeros(7, device=device)
    matrix = wp.array(rows, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.utils.radix_sort_pairs(keys, values, 3000)
        wp.utils.array_scan(keys[:3000], sums, True)
        born = wp.zeros_like(matrix)
        wp.copy(born, matrix)
        wp.launch(total, (7, 90), [born, ends], device=device)
    named = {"keys": keys, "values": values, "sums": sums, "ends": ends}
    graph = reloaded(tmp_path, device, capture, outputs=named)
    del born
    wp.capture_launch(graph)
    order = np.argsort(numbers, kind="stable")
    assert (result(graph, "keys", keys)[:3000] == numbers[order]).all()
    assert (result(graph, "values", values)[:3000] == order).all()
    assert (result(graph, "sums", sums) == np.cumsum(numbers[order])).all()
    exact = rows.astype(np.float64).sum(axis=1)
    assert np.allclose(result(graph, "ends", ends), exact, rtol=1e-5)


def test_a_sparse_product(device, tmp_path):
    """A matrix whose rows are long enough for blocks of a GPU to share them."""
    rng = np.random.default_rng(2)
    rows, columns = rng.integers(0, (40, 30), (4000, 2)).T
    numbers, x = rng.random(4000, np.float32), rng.random(30, np.float32)
    triplets = [wp.array(a, dtype=int, device=device) for a in (rows, columns)]
    matrix = wp.sparse.bsr_from_triplets(40, 30, *triplets, wp.array(numbers, device=device))
    given, product = wp.array(x, device=device), wp.ones(40, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.sparse.bsr_mv(matrix, given, product, alpha=2.0, beta=0.0)
    graph = reloaded(tmp_path, device, capture, inputs={"x": given}, outputs={"y": product})
    del matrix, capture
    for factor in (1.0, -3.0):
        graph.set_param("x", wp.array(factor * x, dtype=float, device=device))
        wp.capture_launch(graph)
        expected = np.bincount(rows, 2.0 * factor * numbers.astype(float) * x[columns], 40)
        assert np.allclose(result(graph, "y", product), expected, rtol=1e-5)


def test_gradients(device, tmp_path):
    x = wp.array(np.arange(6.0), dtype=float, device=device, requires_grad=True)
    y = wp.zeros(6, device=device, requires_grad=True)
    tape = wp.Tape()
    with wp.ScopedCapture(device, apic=True) as capture:
        with tape:
            wp.launch(scale, 6, [x, y, 4.0], device=device)
        y.grad.fill_(1.0)
        tape.backward()
    graph = reloaded(tmp_path, device, capture, outputs={"grad": x.grad})
    wp.capture_launch(graph)
    assert (result(graph, "grad", x.grad) == 4.0).all()


def test_saving_again_replaces_the_code(device, tmp_path):
    x, y = wp.ones(4, device=device), wp.zeros(4, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale, 4, [x, y, 2.0], device=device)
    with wp.ScopedCapture(device, apic=True) as other:
        wp.launch(total, (2, 2), [x.reshape((2, 2)), y], device=device)
    for graph in (capture.graph, other.graph):
        wp.capture_save(graph, tmp_path / "g.wrp", outputs={"y": y})
        assert len(list((tmp_path / "g_modules").iterdir())) == 1
    loaded = wp.capture_load(tmp_path / "g", device=device)
    wp.capture_launch(loaded)
    assert result(loaded, "y", y).tolist() == [2.0, 2.0, 0.0, 0.0]
    with wp.ScopedCapture(device, apic=True) as empty:
        pass
    wp.capture_save(empty.graph, tmp_path / "e")
    wp.capture_launch(wp.capture_load(tmp_path / "e", device=device))


def test_from_bytes(device, tmp_path):
    x, y = wp.ones(4, device=device), wp.zeros(4, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale, 4, [x, y, 2.0], device=device)
    wp.capture_save(capture.graph, tmp_path / "g", outputs={"y": y})
    data = (tmp_path / "g.wrp").read_bytes()
    modules = {p.name: p.read_bytes() for p in (tmp_path / "g_modules").iterdir()}
    for given in (data, bytearray(data), memoryview(data), np.frombuffer(data, np.uint8)):
        graph = wp.capture_load_from_bytes(given, modules | {"other": b""}, device=device)
        wp.capture_launch(graph)
        assert (result(graph, "y", y) == 2.0).all()
    with pytest.raises(wp.WarpError, match=r"needs the code in 'kernels-.*', which was not prov"):
        wp.capture_load_from_bytes(data, device=device)
    wrong = {name: code[:-1] for name, code in modules.items()}
    with pytest.raises(wp.WarpError, match="does not belong to the code"):
        wp.capture_load_from_bytes(data, wrong, device=device)
    with pytest.raises(TypeError, match="data must be a bytes-like object, got int"):
        wp.capture_load_from_bytes(5, device=device)
    with pytest.raises(TypeError, match="modules must be a mapping"):
        wp.capture_load_from_bytes(data, [b""], device=device)
    with pytest.raises(TypeError, match="Module names must be strings, got int"):
        wp.capture_load_from_bytes(data, {1: b""}, device=device)
    with pytest.raises(ValueError, match="Module 'a' must be a C-contiguous buffer"):
        wp.capture_load_from_bytes(data, {"a": memoryview(data)[::2]}, device=device)


def test_another_process_without_the_kernels(device, tmp_path):
    x, y = wp.ones(4, device=device), wp.zeros(4, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale, 4, [x, y, 2.5], device=device)
    wp.capture_save(capture.graph, tmp_path / "g", {"x": x}, {"y": y})
    program = f"""
import warp as wp
graph = wp.capture_load({str(tmp_path / "g")!r}, device={str(device)!r})
wp.capture_launch(graph)
y = wp.zeros(4, device={str(device)!r})
graph.get_param("y", y)
print(y.numpy().tolist())
"""
    environment = os.environ | {"WARP_CACHE_PATH": str(tmp_path / "cache")}
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=environment
    )
    assert run.stdout.strip() == "[2.5, 2.5, 2.5, 2.5]", run.stderr


def test_what_no_file_holds(device, tmp_path):
    out = wp.zeros(1, device=device)
    plain = wp.zeros(4, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(total_exactly, 4, [plain, out], device=device)
    with pytest.raises(wp.WarpError, match="kernel 'total_exactly' is deterministic"):
        wp.capture_save(capture.graph, tmp_path / "g")
    with wp.ScopedCapture(device) as capture:
        out.zero_()
    with pytest.raises(RuntimeError, match="not captured with apic=True"):
        wp.capture_save(capture.graph, tmp_path / "g")
    assert not any(tmp_path.iterdir())


def test_wrong_names_and_arrays(device, tmp_path):
    x, y = wp.ones(4, device=device), wp.zeros((2, 2), device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        x.fill_(2.0)
    graph, path = capture.graph, tmp_path / "g"
    with pytest.raises(ValueError, match="array 'a' has strides, expects a contiguous one"):
        wp.capture_save(graph, path, {"a": y[:, 1]})
    with pytest.raises(ValueError, match="'a' names two arrays, an input and an output"):
        wp.capture_save(graph, path, {"a": x}, {"a": y})
    with pytest.raises(TypeError, match="expects an array for 'a', but got 'ndarray'"):
        wp.capture_save(graph, path, {"a": x.numpy()})
    with pytest.raises(TypeError, match="expects strings as names of arrays, but got 1"):
        wp.capture_save(graph, path, {1: x})
    with pytest.raises(TypeError, match="expects a graph, but got 'int'"):
        wp.capture_save(1, path)
    with pytest.raises(RuntimeError, match="only supported on loaded APIC graphs"):
        graph.set_param("x", x)
    assert graph.params == {}
    # Arrays that the graph does not use can have a name, and arrays without elements, too.
    nothing = wp.zeros(0, device=device)
    wp.capture_save(graph, path, {"x": x, "unused": y, "nothing": nothing})
    loaded = wp.capture_load(path, device=device)
    assert loaded.params["nothing"] == {"size": 0} and loaded.params["unused"] == {"size": 16}
    loaded.set_param("nothing", nothing)
    loaded.get_param("unused", y)
    with pytest.raises(RuntimeError, match=r"Failed to set parameter 'z': .*'nothing', 'unused'"):
        loaded.set_param("z", x)
    with pytest.raises(RuntimeError, match="'x': it has 16 bytes, but got an array of 12 bytes"):
        loaded.get_param("x", wp.zeros(3, device=device))
    with pytest.raises(TypeError, match="expects an array for parameter 'x', but got 'list'"):
        loaded.set_param("x", [1.0])
    with pytest.raises(RuntimeError, match="not captured with apic=True"):
        wp.capture_save(loaded, path)


def test_failed_loads_name_the_file(device, tmp_path):
    with pytest.raises(
        RuntimeError, match=r"Failed to load APIC graph from missing\.wrp: .*cannot"
    ):
        wp.capture_load("missing", device=device)
    x = wp.ones(4, device=device)
    with wp.ScopedCapture(device, apic=True) as capture:
        wp.launch(scale, 4, [x, x, 2.0], device=device)
    wp.capture_save(capture.graph, tmp_path / "g")
    (module,) = (tmp_path / "g_modules").iterdir()
    code = module.read_bytes()
    module.unlink()
    with pytest.raises(RuntimeError, match=r"cannot be read: '.*g_modules/kernels-.*No such file"):
        wp.capture_load(tmp_path / "g", device=device)
    module.write_bytes(code)
    with wp.ScopedCapture("cpu"), pytest.raises(RuntimeError, match="made for|thread captures"):
        wp.capture_load(tmp_path / "g", device="cpu")
    data = Path(tmp_path / "g.wrp").read_bytes()
    for cut in (0, 7, 20, 60, len(data) - 1):
        with pytest.raises(RuntimeError, match="Failed to load APIC graph from bytes: saved graph"):
            wp.capture_load_from_bytes(data[:cut], {module.name: code}, device=device)
