"""Symbolic sparsity and gathers, against sets of Python and sums of NumPy in float64."""

import numpy as np
import pytest

import warp as wp
from warp import fem
from warp._src.fem import grids
from warp._src.fem.assembly import incidence
from warp._src.fem.assembly import pattern as patterns
from warp._src.fem.assembly.gather import add_blocks, spread_adjoint
from warp._src.fem.assembly.pattern import Pattern, batch_size, node_batches

RNG = np.random.default_rng(1)


def array(table):
    return wp.array(np.asarray(table, dtype=np.int32), dtype=int, device="cpu")


def random_tables():
    test = RNG.integers(-1, 40, (60, 5))
    return test, RNG.integers(-1, 30, (60, 3)), 40, 30


TABLES = {
    "triangles": lambda: (*[grids.grid_to_tris(7, 5)] * 2, 48, 48),
    "tetrahedra": lambda: (*[grids.grid_to_tets(3, 4, 2)] * 2, 60, 60),
    "cubes": lambda: (*[grids.grid_to_hexes(4, 3, 2)] * 2, 60, 60),
    "mixed": lambda: (grids.grid_to_hexes(3, 2, 2), np.arange(12)[:, None], 36, 12),
    "unused": random_tables,
    "empty": lambda: (np.zeros((0, 4)), np.zeros((0, 3)), 7, 6),
}


def expected_columns(test, trial, rows):
    found = [set() for _ in range(rows)]
    for rs, cs in zip(test.tolist(), trial.tolist(), strict=True):
        for r in rs:
            if r >= 0:
                found[int(r)].update(int(c) for c in cs if c >= 0)
    return [sorted(columns) for columns in found]


@pytest.fixture(params=[0, 1 << 17], ids=["kernels", "numpy"], autouse=True)
def few(request, monkeypatch):
    """Sparsity is found by kernels, as of large meshes and on GPUs, and by NumPy."""
    monkeypatch.setattr(incidence, "_FEW", request.param)


@pytest.fixture(params=TABLES)
def tables(request):
    return TABLES[request.param]()


@pytest.mark.parametrize("entries", [4 << 20, 200, 1])
def test_columns_are_the_union_of_the_elements(tables, entries, monkeypatch):
    monkeypatch.setattr(patterns, "ENTRIES", entries)
    test, trial, rows, columns = tables
    pattern = Pattern(array(test), array(trial), rows, columns)
    offsets, found = pattern.offsets.numpy(), pattern.columns.numpy()
    expected = expected_columns(test, trial, rows)
    assert [found[a:b].tolist() for a, b in zip(offsets[:-1], offsets[1:], strict=True)] == expected
    assert pattern.nnz == sum(map(len, expected))


def test_numpy_and_kernels_find_the_same_contributions(tables, monkeypatch):
    found = []
    for few in (0, 1 << 17):
        monkeypatch.setattr(incidence, "_FEW", few)
        test, trial, rows, columns = tables
        batch = Pattern(array(test), array(trial), rows, columns).batches[0]
        begins = batch.begins.numpy()
        nodes = node_batches(array(test), rows)[0] if len(test) else batch
        used = nodes.begins.numpy()
        found.append((begins, batch.entries.numpy()[: begins[-1]]))
        found[-1] += (used, nodes.entries.numpy()[: used[-1]])
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("limit", [10**6, 7, 1])
def test_matrix_is_the_sum_of_element_matrices(tables, limit, monkeypatch):
    monkeypatch.setattr(patterns, "batch_size", lambda block_bytes: limit)
    test, trial, rows, columns = tables
    blocks = RNG.standard_normal((len(test), test.shape[1], trial.shape[1])).astype(np.float32)
    dense = np.zeros((rows + 1, columns + 1))
    for e, (r, c) in enumerate(zip(test.astype(int), trial.astype(int), strict=True)):
        np.add.at(dense, (r[:, None], c[None, :]), blocks[e].astype(np.float64))
    pattern = Pattern(array(test), array(trial), rows, columns)
    expected = expected_columns(test, trial, rows)
    assert pattern.columns.numpy().tolist() == sum(expected, [])
    values = wp.full(pattern.nnz, np.nan, dtype=wp.float64, device="cpu")
    if len(pattern.batches) != 1:
        values.zero_()
    for batch in pattern.batches:
        part = wp.array(blocks[batch.first : batch.first + batch.count].ravel(), device="cpu")
        add_blocks(batch, part, values, adds=len(pattern.batches) > 1)
    row = np.repeat(np.arange(rows), np.diff(pattern.offsets.numpy()))
    expected = dense[row, pattern.columns.numpy()]
    np.testing.assert_allclose(values.numpy(), expected, rtol=1e-14, atol=1e-13)


def test_batches_of_matrices_give_the_same_bits(monkeypatch):
    test, trial, rows, columns = TABLES["cubes"]()
    blocks = RNG.standard_normal((len(test), 64)).astype(np.float32)
    results = []
    for limit in (10**6, 5):
        monkeypatch.setattr(patterns, "batch_size", lambda block_bytes, limit=limit: limit)
        pattern = Pattern(array(test), array(trial), rows, columns)
        values = wp.zeros(pattern.nnz, dtype=wp.float64, device="cpu")
        for batch in pattern.batches:
            part = wp.array(blocks[batch.first : batch.first + batch.count].ravel(), device="cpu")
            add_blocks(batch, part, values, adds=True)
        results.append(values.numpy())
    np.testing.assert_array_equal(*results)


@pytest.mark.parametrize("limit", [10**6, 3])
def test_adjoint_of_a_gather_is_its_transpose(tables, limit, monkeypatch):
    monkeypatch.setattr(patterns, "batch_size", lambda block_bytes: limit)
    test, _, rows, _ = tables
    seed = RNG.standard_normal(rows)
    adjoints = wp.array(seed, dtype=wp.float64, device="cpu")
    for batch in node_batches(array(test), rows):
        part = test[batch.first : batch.first + batch.count].astype(int)
        found = wp.zeros(part.size, dtype=wp.float32, device="cpu")
        spread_adjoint(batch, adjoints, found)
        expected = np.where(part >= 0, np.append(seed, 0.0)[part], 0.0).astype(np.float32)
        np.testing.assert_array_equal(found.numpy(), expected.ravel())


def test_a_batch_holds_at_most_64_mib_of_blocks():
    size = 8 * 8 * 9 * 4
    assert batch_size(size) * size <= 64 << 20
    assert batch_size(10**12) == 1


def test_tables_of_different_elements_are_named():
    with pytest.raises(ValueError, match="one number of elements, but got 2 and 3"):
        Pattern(array([[0], [1]]), array([[0], [1], [2]]), 2, 3)


@fem.integrand
def product(s: fem.Sample, u: fem.Field, v: fem.Field):
    return u(s) * v(s)


@fem.integrand
def one(s: fem.Sample, v: fem.Field):
    return v(s)


@pytest.mark.parametrize("degree", [1, 2])
def test_a_graph_finds_sparsity_that_is_not_known_yet(degree, device):
    """The first assembly of a matrix and of a vector may be in a capture."""

    def fields():
        geo = fem.Grid2D(res=wp.vec2i(6, 5))
        space = fem.make_polynomial_space(geo, degree=degree)
        return {"u": fem.make_trial(space), "v": fem.make_test(space)}

    with wp.ScopedDevice(device):
        expected = fem.integrate(product, fields=fields())
        known = fields()
        with wp.ScopedCapture(device=device) as capture:
            matrix = fem.integrate(product, fields=known)
            vector = fem.integrate(one, fields={"v": known["v"]})
        nnz = expected.nnz
        # There is room for every pair of nodes of every cell.
        assert matrix.nnz == 30 * (degree + 1) ** 4
        for _ in range(2):
            wp.capture_launch(capture.graph)
            np.testing.assert_array_equal(matrix.offsets.numpy(), expected.offsets.numpy())
            for name in ("columns", "values"):
                found = getattr(matrix, name).numpy()[:nnz]
                np.testing.assert_array_equal(found, getattr(expected, name).numpy()[:nnz])
            assert vector.numpy().sum() == pytest.approx(1.0, rel=1e-6)
            assert matrix.nnz_sync() == nnz
        again = fem.integrate(product, fields=known)
        assert again.nnz == nnz
        np.testing.assert_array_equal(again.values.numpy(), expected.values.numpy())


def test_a_graph_finds_the_sparsity_of_many_elements_at_once(monkeypatch):
    """A capture has one batch where an assembly outside of it has several."""
    monkeypatch.setattr(patterns, "ENTRIES", 64)
    with wp.ScopedDevice("cpu"):
        space = fem.make_polynomial_space(fem.Grid2D(res=wp.vec2i(6, 5)), degree=1)
        fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
        with wp.ScopedCapture(device="cpu") as capture:
            matrix = fem.integrate(product, fields=fields)
        wp.capture_launch(capture.graph)
        expected = fem.integrate(product, fields=fields)
        assert len(fem.pattern(fields["v"], fields["u"]).batches) > 1
        nnz = expected.nnz
        np.testing.assert_array_equal(matrix.offsets.numpy(), expected.offsets.numpy())
        np.testing.assert_array_equal(matrix.columns.numpy()[:nnz], expected.columns.numpy())
        np.testing.assert_array_equal(matrix.values.numpy()[:nnz], expected.values.numpy())


def test_a_graph_cannot_join_parts_of_unknown_sparsity(monkeypatch):
    monkeypatch.setattr(patterns, "ENTRIES", 64)
    monkeypatch.setattr(patterns, "CAPTURED_ENTRIES", 64)
    with wp.ScopedDevice("cpu"):
        geo = fem.Grid2D(res=wp.vec2i(6, 5))
        space = fem.make_polynomial_space(geo, degree=1)
        fields = {"u": fem.make_trial(space), "v": fem.make_test(space)}
        with wp.ScopedCapture(device="cpu"):
            with pytest.raises(RuntimeError, match="call `integrate` once before it, or"):
                fem.integrate(product, fields=fields)
        fem.pattern(fields["v"], fields["u"])
        with wp.ScopedCapture(device="cpu") as capture:
            matrix = fem.integrate(product, fields=fields)
        wp.capture_launch(capture.graph)
        assert matrix.values.numpy().sum() == pytest.approx(1.0, rel=1e-6)
