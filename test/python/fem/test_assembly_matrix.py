"""Matrices and vectors from element blocks: options, bits, adjoints; forms are stand-ins."""

from types import SimpleNamespace

import numpy as np
import pytest

import warp as wp
from warp._src.fem import grids
from warp._src.fem.assembly import pattern as patterns
from warp._src.fem.assembly.matrix import assemble_matrix, pattern_of
from warp._src.fem.assembly.vector import assemble_vector

RNG = np.random.default_rng(5)
TABLE = grids.grid_to_hexes(3, 2, 2)
NODES = 36


@wp.kernel
def scaled(
    first: int, source: wp.array(dtype=float), c: wp.array(dtype=float), out: wp.array(dtype=float)
):
    i = wp.tid()
    out[i] = c[0] * c[0] * source[first + i]


class Form:
    """Blocks that are given numbers times the square of a coefficient."""

    block_dtype = wp.float32

    def __init__(self, width, coefficient=None):
        topology = SimpleNamespace()
        partition = Partition(topology)
        self.test = self.trial = SimpleNamespace(space_partition=partition)
        self.domain, self.device = "cells", wp.get_device("cpu")
        self.width = width
        self.numbers = RNG.standard_normal(len(TABLE) * width).astype(np.float32)
        self.source = wp.array(self.numbers, device="cpu")
        self.c = coefficient or wp.ones(1, dtype=float, device="cpu")
        self.requires_grad = self.c.requires_grad

    def test_table(self, device):
        return wp.array(TABLE.astype(np.int32), dtype=int, device=device)

    trial_table = test_table

    def blocks(self, first, count, out):
        wp.launch(
            scaled, count * self.width, [first * self.width, self.source, self.c, out], device="cpu"
        )

    def dense(self):
        result = np.zeros((NODES, NODES))
        for nodes, block in zip(TABLE, self.numbers.reshape(-1, 8, 8), strict=True):
            np.add.at(result, (nodes[:, None], nodes), block.astype(np.float64))
        return result


class Partition:
    def __init__(self, topology):
        self.space_topology = topology

    def node_count(self):
        return NODES


def to_dense(matrix):
    dense = np.zeros((matrix.nrow, matrix.ncol))
    offsets, columns, values = (a.numpy() for a in (matrix.offsets, matrix.columns, matrix.values))
    for r in range(matrix.nrow):
        end = (
            offsets[r + 1]
            if matrix.row_counts is None
            else offsets[r] + matrix.row_counts.numpy()[r]
        )
        dense[r, columns[offsets[r] : end]] = values[offsets[r] : end]
    return dense


@pytest.fixture(params=[10**6, 5], ids=["one batch", "batches"])
def form(request, monkeypatch):
    monkeypatch.setattr(patterns, "batch_size", lambda block_bytes: request.param)
    return Form(64)


def test_matrix_and_refill_have_the_same_bits(form):
    first = assemble_matrix(form)
    np.testing.assert_allclose(to_dense(first), form.dense(), rtol=2e-7, atol=1e-7)
    values, address = first.values.numpy(), first.values.ptr
    assert assemble_matrix(form, output=first) is first
    assert first.values.ptr == address and pattern_of(form) is pattern_of(form)
    np.testing.assert_array_equal(first.values.numpy(), values)
    for name in ("auto", "triplets", "row_compress", "mapped", "mapped_atomic"):
        again = assemble_matrix(form, bsr_options={"construction": name})
        np.testing.assert_array_equal(again.values.numpy(), values)
        reused = assemble_matrix(
            form, again, bsr_options={"construction": name, "capacity": "reuse"}
        )
        assert reused.columns is again.columns


def test_batches_leave_the_bits(monkeypatch):
    """Values in float32 are rounded once, whatever number of batches adds to them."""
    found, given = [], Form(64)
    for limit in (10**6, 5, 1):
        monkeypatch.setattr(patterns, "batch_size", lambda block_bytes, limit=limit: limit)
        form = Form(64)
        form.source.assign(given.source)
        found.append(assemble_matrix(form).values.numpy())
        assert len(pattern_of(form).batches) == max(1, -(-len(TABLE) // limit))
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_output_is_added_to(form):
    matrix = assemble_matrix(form, output_dtype=wp.float64)
    assert matrix.dtype is wp.float64
    assemble_matrix(form, output=matrix, add=True)
    np.testing.assert_allclose(to_dense(matrix), 2 * form.dense(), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("topology", ["compact", "masked", "padded"])
def test_topologies(form, topology):
    matrix = (
        assemble_matrix(form, bsr_options={"topology": topology}) if topology == "padded" else None
    )
    if topology == "masked":
        matrix = assemble_matrix(form)
    for _ in range(2):
        matrix = assemble_matrix(form, matrix, bsr_options={"topology": topology})
        np.testing.assert_allclose(to_dense(matrix), form.dense(), rtol=2e-7, atol=1e-7)
    assert matrix.status_sync() == 0


def test_changing_a_matrix_leaves_the_pattern(form):
    matrix = assemble_matrix(form)
    matrix.columns.zero_()
    matrix.offsets.zero_()
    np.testing.assert_allclose(to_dense(assemble_matrix(form)), form.dense(), rtol=2e-7, atol=1e-7)


def test_adjoint_of_matrix_and_vector(monkeypatch):
    for limit in (10**6, 5):
        monkeypatch.setattr(patterns, "batch_size", lambda block_bytes, limit=limit: limit)
        c = wp.array([3.0], dtype=float, device="cpu", requires_grad=True)
        form, linear = Form(64, c), Form(8, c)
        vector = wp.zeros(NODES, dtype=float, device="cpu", requires_grad=True)
        with wp.Tape() as tape:
            matrix = assemble_matrix(form)
            assemble_vector(linear, vector)
        assert matrix.values.requires_grad
        seeds = RNG.standard_normal(matrix.nnz).astype(np.float32)
        weights = RNG.standard_normal(NODES).astype(np.float32)
        W = np.zeros((NODES, NODES))
        W[np.repeat(np.arange(NODES), np.diff(matrix.offsets.numpy())), matrix.columns.numpy()] = (
            seeds
        )
        tape.backward(
            grads={
                matrix.values: wp.array(seeds, device="cpu"),
                vector: wp.array(weights, device="cpu"),
            }
        )
        load = np.bincount(TABLE.ravel(), weights=linear.numbers)
        expected = 6.0 * ((W * form.dense()).sum() + load @ weights)
        np.testing.assert_allclose(c.grad.numpy(), [expected], rtol=1e-5)


def test_vector(form):
    linear = Form(8)
    expected = np.bincount(TABLE.ravel(), weights=linear.numbers, minlength=NODES)
    out = wp.full(NODES, 2.0, dtype=wp.float64, device="cpu")
    assemble_vector(linear, out, add=True)
    np.testing.assert_allclose(out.numpy(), expected + 2.0, rtol=1e-12, atol=1e-14)
    assemble_vector(linear, out)
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"construction": "magic"}, "'construction' expects one of .*, but got 'magic'"),
        ({"capacity": "reuse"}, "'capacity'='reuse' requires an 'output' matrix"),
        ({"inplace": True}, "'bsr_options' has no option 'inplace'"),
        (
            {"construction": "mapped", "topology": "padded"},
            "requires 'topology'='compact', but got 'padded'",
        ),
    ],
)
def test_options_that_do_not_fit_are_named(form, options, message):
    with pytest.raises((ValueError, RuntimeError), match=message):
        assemble_matrix(form, bsr_options=options)


def test_output_that_does_not_fit_is_named(form):
    from warp.sparse import bsr_zeros

    with pytest.raises(
        RuntimeError, match="expects 36 rows and 36 columns of blocks, but got 2 and 3"
    ):
        assemble_matrix(form, bsr_zeros(2, 3, float, device="cpu"))
    with pytest.raises(RuntimeError, match=r"blocks of shape \(1, 1\), but got \(2, 2\)"):
        assemble_matrix(form, bsr_zeros(36, 36, wp.mat22, device="cpu"))
    with pytest.raises(
        RuntimeError, match="expects room for .* blocks, but 'output' has room for 0"
    ):
        assemble_matrix(
            form, bsr_zeros(36, 36, float, device="cpu"), bsr_options={"capacity": "reuse"}
        )
    with pytest.raises(RuntimeError, match=r"expects shape \(36,\), but got \(7,\)"):
        assemble_vector(Form(8), wp.zeros(7, dtype=float, device="cpu"))
