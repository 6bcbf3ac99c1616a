"""Comparison of packages: references, programs of this package, processes, pages."""

import sys

import numpy as np
import pytest

from warp.compare import PACKAGES, compare
from warp.compare.__main__ import main
from warp.compare._pages import _ratio, markdown
from warp.compare._programs import PROGRAMS, make_inputs, reference


@pytest.fixture(scope="module")
def own():
    """Records of all programs in quick sizes, by this package alone."""
    head, records = compare(quick=True, repeats=3, budget=0.01)
    return head, {r["program"]: r for r in records if r["package"] == "warp-mlir"}


@pytest.mark.parametrize("name", PROGRAMS)
def test_own_programs_agree_with_float64(own, name):
    record = own[1][name]
    assert record["status"] == "ok", record
    # Orbits near the border of the Mandelbrot set escape a step earlier or later in float32.
    assert record["error"] < (1e-2 if name == "mandelbrot" else 2e-6)
    if PROGRAMS[name].wrt:
        assert record["gradient_error"] < 1e-5
        assert record["gradient_s"] > 0.0
    assert min(record["first_s"], record["forward_s"], record["memory_mib"]) > 0.0


def test_slope_is_the_derivative():
    """Against the derivative of the formula, taken by hand."""
    inputs = make_inputs("elementary", 1000)
    found = reference("elementary", inputs)
    x = inputs["x"].astype(np.float64)
    gaussian = np.exp(-x * x)
    slope = np.cos(x) * gaussian - 2.0 * x * np.sin(x) * gaussian
    slope += 0.5 / np.sqrt(x + 4.0) + 2.0 * x / (1.0 + x * x)
    expected = np.sum(found["weights"].astype(np.float64) * slope * found["direction"])
    assert float(found["slope"]) == pytest.approx(expected, rel=1e-6)


def test_densities_count_every_neighbour():
    """Against all pairs of points."""
    inputs = make_inputs("neighbours", 300)
    x = inputs["x"].astype(np.float64)
    r2 = ((x[:, None] - x[None]) ** 2).sum(-1)
    expected = np.where(r2 < 1.0, (1.0 - r2) ** 3, 0.0).sum(1)
    assert reference("neighbours", inputs)["result"] == pytest.approx(expected, rel=1e-12)


def test_forces_of_springs_cancel():
    inputs = make_inputs("springs", 16)
    force = reference("springs", inputs)["result"]
    assert np.abs(force).max() > 1.0
    assert np.abs(force.sum(0)).max() < 1e-9


def test_a_package_that_is_not_there_has_a_record(tmp_path):
    """An interpreter without the package: its message is in the page, and others are measured."""
    bare = tmp_path / "python"
    bare.write_text(f'#!/bin/sh\nexec "{sys.executable}" -S "$@"\n')
    bare.chmod(0o755)
    head, records = compare(["saxpy"], pythons={"numba": bare}, quick=True, repeats=3)
    lost = next(r for r in records if r["package"] == "numba")
    assert lost["status"] == "failed" and "No module named" in lost["reason"]
    text = "\n".join(markdown(head, records))
    assert "## Without a result" in text and "No module named" in text
    assert "| saxpy | warp-mlir |" in text


@pytest.mark.parametrize("load, said", [(1.2, False), (17.0, True)])
def test_a_busy_machine_is_named(load, said):
    """Times of a run that shared its cores are not those of a machine at rest."""
    head = {"time": "2026-01-01T00:00:00", "processor": "P", "cores": 2, "device": "cpu"}
    head |= {"devices": {}, "quick": False, "load": load}
    text = "\n".join(markdown(head, []))
    assert ("17 wanted 2 cores" in text) == said


def test_a_process_that_does_not_end_is_ended(tmp_path):
    slow = tmp_path / "python"
    slow.write_text("#!/bin/sh\nexec sleep 60\n")
    slow.chmod(0o755)
    _, records = compare(["saxpy"], pythons={"jax": slow}, quick=True, repeats=3, limit=20.0)
    lost = next(r for r in records if r["package"] == "jax")
    assert (lost["status"], lost["reason"]) == ("timeout", "did not end within 20 s")


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["sagspy"], "no program 'sagspy'; there are 'saxpy'"),
        (["--python", "julia=/bin/true"], "no package 'julia'; there are 'warp-mlir', 'peer'"),
        (["--python", "peer"], "--python expects PACKAGE=PATH, but got 'peer'"),
        (["--python", "peer=/nowhere/python"], "no interpreter '/nowhere/python' for 'peer'"),
    ],
)
def test_wrong_arguments_are_named(capsys, arguments, message):
    assert main(arguments) == 2
    assert message in capsys.readouterr().err


def test_pages(tmp_path, capsys):
    status = main(["saxpy", "--quick", "--repeats", "3", "--output", str(tmp_path)])
    assert status == 0
    page = (tmp_path / "compare.html").read_text()
    assert page.startswith("<!doctype html>") and '<th scope="col">gradient error</th>' in page
    assert "<h2 id=" in page and "http" not in page
    assert (tmp_path / "compare.jsonl").read_text().count("\n") >= 2
    assert set(PACKAGES) >= {"peer", "drjit", "jax", "numba", "taichi", "torch"}


@pytest.mark.parametrize(
    ("value", "text"), [(0.0371, "0.037x"), (1.0, "1x"), (4.52, "4.5x"), (2634.0, "2600x")]
)
def test_ratios_have_two_digits_and_no_power_of_ten(value, text):
    assert _ratio(value) == text
