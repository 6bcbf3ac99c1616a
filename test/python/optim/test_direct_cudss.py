"""Direct solvers by cuDSS, for which a library with the same C interface stands in."""

import ctypes
import gc
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from test_direct import definite, pytestmark, sparse_of, stiff  # noqa: F401

import warp as wp
from warp._src.optim.linear import direct, direct_cudss
from warp._src.optim.linear.direct_factors import UntrustedFactorsError
from warp.optim import linear

KINDS = ["ldlt", "cholesky", "lu"]
COMPILER = shutil.which("cc") or shutil.which("clang")
SOURCE = Path(__file__).with_name("fake_cudss.c")


@pytest.fixture(scope="module")
def libraries(tmp_path_factory):
    """A library of version 1.0, and one by number for each minor version before it."""
    if COMPILER is None:
        pytest.skip("needs a C compiler")

    known: dict = {}

    def made(minor=None):
        if minor not in known:
            path = tmp_path_factory.mktemp("cudss") / "libcudss.so"
            define = [] if minor is None else [f"-DMINOR_ONLY={minor}"]
            command = [COMPILER, "-shared", "-fPIC", "-O1", *define, SOURCE, "-o", path, "-lm"]
            subprocess.run(command, check=True)
            known[minor] = str(path)
        return known[minor]

    return made


@pytest.fixture
def cudss(libraries, monkeypatch):
    """Takes matrices of the host for those of a GPU; gives the library's counts."""

    def use(minor=None):
        path = libraries(minor)
        monkeypatch.setattr(direct_cudss, "_candidates", lambda: iter([path]))
        direct_cudss.library.cache_clear()
        direct_cudss._engine.cache_clear()
        return (ctypes.c_int64 * 4).in_dll(ctypes.CDLL(path), "fake_cudss_counts")

    monkeypatch.setattr(direct, "_is_on_gpu", lambda A: True)
    monkeypatch.setattr(wp.config, "quiet", False)
    yield use
    gc.collect()
    direct_cudss.library.cache_clear()
    direct_cudss._engine.cache_clear()


@pytest.mark.parametrize("minor", [None, 7])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("block", [0, 1, 3])
def test_solutions_are_those_of_numpy(cudss, kind, block, minor):
    counts = cudss(minor)
    values = definite(30)
    if kind == "lu":
        values += np.triu(np.random.default_rng(4).normal(size=(30, 30)), 1) * (values != 0)
    if block:
        A = sparse_of(values, "cpu", block)
    else:
        A = wp.array(values, dtype=wp.float64, device="cpu")
    solver = getattr(linear, kind)(A)
    assert counts[0] == counts[1] >= 1
    b = np.random.default_rng(2).normal(size=30)
    expected = np.linalg.solve(values, b)
    dtype = wp.vec3d if block == 3 else wp.float64
    given = wp.array(b.reshape(-1, 3) if block == 3 else b, dtype=dtype, device="cpu")
    found = solver.solve(given)
    assert found.dtype is given.dtype and found.shape == given.shape
    np.testing.assert_allclose(found.numpy().reshape(-1), expected, rtol=1e-10, atol=1e-11)
    many = wp.array(np.stack([b, 2 * b]), dtype=wp.float64, device="cpu")
    np.testing.assert_allclose(solver.solve(many).numpy()[1], 2 * expected, rtol=1e-10, atol=1e-11)
    single = solver.solve(wp.array(b, dtype=wp.float32, device="cpu"))
    assert single.dtype is wp.float32
    np.testing.assert_allclose(single.numpy(), expected, rtol=1e-4, atol=1e-5)
    assert 0.3 < solver.condition / np.linalg.cond(values, 1) <= 1.0 + 1e-9
    assert solver.nnz > 0


def test_right_hand_sides_and_solutions_with_gaps(cudss):
    cudss()
    values = definite(6)
    solver = linear.lu(sparse_of(values, "cpu", 3))
    b = np.random.default_rng(3).normal(size=(2, 6))
    expected = np.linalg.solve(values, b.T).T
    wide = wp.array(np.stack([b, b], axis=2), dtype=wp.float64, device="cpu")
    x = wp.zeros((2, 12), dtype=wp.float32, device="cpu")
    solver.solve(wide[:, :, 1], x[:, ::2])
    np.testing.assert_allclose(x.numpy()[:, ::2], expected, rtol=1e-4, atol=1e-5)
    assert not x.numpy()[:, 1::2].any()
    vectors = wp.zeros((2, 2, 2), dtype=wp.vec3d, device="cpu")
    solver.solve(wide[:, :, 0], vectors[:, :, 1])
    found = vectors.numpy()[:, :, 1].reshape(2, 6)
    np.testing.assert_allclose(found, expected, rtol=1e-10)
    assert solver.solve(wide[:0, :, 0]).shape == (0, 6)


@pytest.mark.parametrize("kind", KINDS)
def test_residuals_of_stiff_systems_are_rounding(cudss, kind):
    cudss()
    values = stiff(200, 12.0)
    b = values @ np.sin(np.arange(200.0))
    solver = getattr(linear, kind)(sparse_of(values, "cpu"))
    found = solver.solve(wp.array(b, dtype=wp.float64, device="cpu")).numpy()
    assert (np.abs(values @ found - b) / (np.abs(values) @ np.abs(found))).max() < 1e-14


@pytest.mark.parametrize("kind", KINDS)
def test_gradients_are_those_of_the_host(cudss, kind, monkeypatch):
    cudss()
    rng = np.random.default_rng(7)
    values, b, seed = definite(6), rng.normal(size=(2, 6)), rng.normal(size=(2, 6))
    if kind == "lu":
        values = values + np.triu(rng.normal(size=(6, 6)))

    def gradients(kept):
        A = sparse_of(values, "cpu")
        A.values.requires_grad = True
        right = wp.array(b, dtype=wp.float64, device="cpu", requires_grad=True)
        with wp.Tape() as tape:
            solver = getattr(linear, kind)(A)
            x = solver.solve(right)
        assert isinstance(solver._factors, kept)
        tape.backward(grads={x: wp.array(seed, dtype=wp.float64, device="cpu")})
        return A.values.grad.numpy(), right.grad.numpy()

    found = gradients(direct_cudss.CudssFactors)
    monkeypatch.setattr(direct, "_is_on_gpu", lambda A: False)
    for one, other in zip(found, gradients(direct.Factors), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)


def test_other_numbers_keep_the_analysis_and_factors_are_freed(cudss):
    counts = cudss()
    begin = counts[3]
    values = definite(12)
    solver = linear.ldlt(sparse_of(values, "cpu"))
    b = wp.array(np.ones(12), dtype=wp.float64, device="cpu")
    analyses, factors = counts[0], counts[1]
    solver.refactor(sparse_of(3.0 * values, "cpu"))
    assert (counts[0], counts[1]) == (analyses, factors + 1)
    expected = np.linalg.solve(3.0 * values, np.ones(12))
    np.testing.assert_allclose(solver.solve(b).numpy(), expected, rtol=1e-10)
    solver.refactor(sparse_of(np.diag(np.arange(1.0, 13.0)), "cpu"))
    assert counts[0] == analyses + 1
    np.testing.assert_allclose(solver.solve(b).numpy(), 1 / np.arange(1.0, 13.0), rtol=1e-12)
    del solver
    gc.collect()
    assert counts[3] == begin


def test_a_matrix_that_needs_pivoting_is_factored_on_the_host(cudss, capfd):
    cudss()
    # Pivots that are zero, and rows in an order that elimination without a search fails at.
    values = np.roll(np.diag([1e-30, 2.0, 3.0, 4.0]), 1, 0) + np.triu(np.full((4, 4), 1e3), 2)
    A = wp.array(values, dtype=wp.float64, device="cpu")
    with pytest.raises(UntrustedFactorsError):
        direct_cudss.CudssFactors("lu", A, wp.float64)
    values = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1e-3]])
    solver = linear.lu(wp.array(values, dtype=wp.float64, device="cpu"))
    found = solver.solve(wp.array([1.0, 2.0, 3.0], dtype=wp.float64, device="cpu"))
    np.testing.assert_allclose(found.numpy(), np.linalg.solve(values, [1.0, 2.0, 3.0]), rtol=1e-12)


def test_a_singular_matrix_is_the_error_of_the_host(cudss, capfd):
    cudss()
    n = 20
    values = 2 * np.eye(n) - np.diag(np.ones(n - 1), 1) - np.diag(np.ones(n - 1), -1)
    values[0, 0] = values[-1, -1] = 1.0
    with pytest.raises(linear.FactorError, match="zero up to rounding") as caught:
        linear.ldlt(sparse_of(values, "cpu"))
    assert 0 <= caught.value.index < n
    assert "a known solution comes back with an error of" in capfd.readouterr().err


@pytest.mark.parametrize("minor", [None, 5])
def test_without_the_library_a_notice_names_the_command(cudss, monkeypatch, capfd, minor):
    if minor:
        cudss(minor)
    else:
        monkeypatch.setattr(direct_cudss, "_candidates", lambda: iter(()))
        direct_cudss.library.cache_clear()
        direct_cudss._engine.cache_clear()
    solver = linear.ldlt(sparse_of(definite(5), "cpu"))
    assert isinstance(solver._factors, direct.Factors)
    error = capfd.readouterr().err
    assert "pip install nvidia-cudss-cu13" in error and "factored on the host" in error
    assert ("is older than 0.7" in error) == bool(minor)
