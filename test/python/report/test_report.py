"""The report measures, judges and survives scenes; its tables follow from its records."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import programs
import warp.report as report
from warp.report.__main__ import main
from warp.report._analysis import compare
from warp.report._records import RecordFile
from warp.report._scene import registered
from warp.report._worker import load

FILE = str(Path(__file__).parent / "scenes_for_tests.py")
load(FILE)


def run(name, tmp_path, **options):
    options = {"limit": None, "repeats": 3, "budget": 0.02} | options
    return report.run([registered()[name]], output=tmp_path, **options)


def test_errors_orders_and_pages(tmp_path):
    records = run("decay", tmp_path)
    errors = [record["errors"]["x"] for record in records]
    steps = [round(1.0 / record["parameters"]["dt"]) for record in records]
    expected = [abs((1.0 - 1.0 / n) ** n / np.exp(-1.0) - 1.0) for n in steps]
    np.testing.assert_allclose(errors, expected, rtol=1e-9)
    assert report.observed_order(records, "dt", "x") == pytest.approx(1.0, abs=0.05)
    assert all(record["parts"]["steps"] > 0.0 for record in records)
    assert {record["verdict"] for record in records} == {"green"}
    for page in ("report.md", "report.html", "records.csv", "decay_errors.svg", "decay_times.svg"):
        assert (tmp_path / page).stat().st_size > 300
    svg = (tmp_path / "decay_errors.svg").read_text()
    assert "currentColor" in svg and "prefers-color-scheme: dark" in svg
    head, read = report.read_records(tmp_path / "records.jsonl")
    assert read == records and head["cores"] > 0


def test_without_matplotlib_there_are_pages_without_figures(tmp_path):
    program = f"""
import pathlib, sys
sys.modules["matplotlib"] = None
import warp.report as report
from warp.report._scene import registered
from warp.report._worker import load
load({FILE!r})
report.run([registered()["decay"]], output=pathlib.Path({str(tmp_path)!r}), repeats=1, budget=0.01)
"""
    status, out, err = programs.run(programs.write_program(program))
    assert status == 0, err
    assert "none: they need the package `matplotlib`" in (tmp_path / "report.md").read_text()
    assert {page.name for page in tmp_path.iterdir()} == {
        *("report.md", "report.html", "records.csv", "records.jsonl")
    }


def test_time_to_error_interpolates_in_logarithms():
    def point(error, seconds, status="ok"):
        times = {"median": seconds}
        return {"errors": {"x": error}, "seconds": times, "status": status}

    curve = [point(1e-1, 1.0), point(1e-3, 100.0), point(1e-9, 1.0, "diverged")]
    assert report.time_to_error(curve, "x", 1e-2) == pytest.approx(10.0)
    assert report.time_to_error(curve, "x", 0.5) == 1.0
    assert report.time_to_error(curve, "x", 1e-4) is None


@pytest.mark.parametrize(
    "name, status, verdict",
    [
        ("not_finite", "nonfinite", "red"),
        ("far_off", "diverged", "red"),
        ("expected", "diverged", "green"),
        ("no_reference", "ok", "green"),
    ],
)
def test_verdicts(name, status, verdict, tmp_path):
    (record,) = run(name, tmp_path)
    assert (record["status"], record["verdict"]) == (status, verdict)


def test_a_reference_that_is_not_ten_times_better_does_not_judge(tmp_path):
    (record,) = run("too_coarse", tmp_path)
    assert record["errors"] == {} and record["unjudged"]["x"] == pytest.approx(0.01)
    assert "too small for the reference" in (tmp_path / "report.md").read_text()


def test_points_that_do_not_end_or_take_the_process_down(tmp_path):
    first, second = run("misbehaves", tmp_path, limit=1.0)
    assert first["status"] == "timeout" and "did not end within 1 s" in first["reason"]
    assert second["status"] == "failed" and "exit status 7" in second["reason"]


def test_exceptions_and_missing_parameters_are_named(tmp_path):
    good, luck, missing = run("raises", tmp_path)
    assert good["status"] == "ok"
    assert "RuntimeError: no luck" in luck["reason"] and "scenes_for_tests.py:" in luck["reason"]
    assert "no parameter 'stiffness'; it has 'n'" in missing["reason"]


# Steps that are large beside what they resolve have large errors, which are those of the method.
@pytest.mark.parametrize(
    ("name", "file", "sweeps"),
    [
        ("springs", "springs", {"dt": (1.4, 1.8, 2.1), "stiffness": (1e10,)}),
        ("bounce", "contact", {"dt": (1.8e-4, 3e-5), "stiffness": (1e6,)}),
        ("neo_hookean", "materials", {"poisson": (0.4999,), "stretch": (1.0, 0.0)}),
    ],
)
def test_edges_of_scenes(name, file, sweeps, tmp_path):
    load(str(Path(report.__file__).parent / "scenes" / f"{file}.py"))
    records = run(
        name,
        tmp_path,
        sweeps=tuple(report.Sweep(key, values=values) for key, values in sweeps.items()),
    )
    assert [r["parameters"] for r in records if r["verdict"] != "green"] == []


def test_absent_device_and_sweep_of_one_point(tmp_path):
    sweep = report.Sweep("dt", values=(0.25,))
    (record,) = run("decay", tmp_path, devices=("cuda:99",), sweeps=(sweep,))
    assert record["status"] == "unsupported" and "cuda:99" in record["reason"]


def test_compare_tells_worse_from_noise():
    def record(median, error, spread=0.01, status="ok"):
        return {
            "scene": "s", "device": "cpu", "dtype": "float64", "parameters": {"dt": 1.0},
            "status": status, "expected": "ok", "errors": {"x": error}, "spread": spread,
            "seconds": {"median": median},
        }  # fmt: skip

    def judge(*records):
        return {row[1]: row[4] for row in compare(records[1:], records[:1])}

    assert judge(record(1.0, 1e-3), record(1.04, 1e-3)) == {"run time": "noise"}
    assert judge(record(1.0, 1e-3), record(1.2, 1e-3, 0.3)) == {"run time": "noise"}
    changed = judge(record(1.0, 1e-3), record(1.2, 5e-4))
    assert changed == {"run time": "worse", "error of x": "better"}
    assert judge(record(1.0, 1e-3), record(1.0, 1e-3, status="failed")) == {"status": "worse"}


def test_interrupted_and_full_disk_keep_what_was_measured(tmp_path, monkeypatch, capsys):
    count = []

    def interrupt(self, case):
        count.append(1)
        if len(count) > 2:
            raise KeyboardInterrupt
        return measured(self, case)

    from warp.report._worker import Worker

    measured = Worker.measure
    monkeypatch.setattr(Worker, "measure", interrupt)
    assert len(run("decay", tmp_path)) == 2
    assert "**Interrupted**: 2 of 5" in (tmp_path / "report.md").read_text()
    full = RecordFile("/dev/full", {"kind": "run"})
    full.append({"x": 1})
    assert full.records == [{"x": 1}] and "No space left" in full.error
    assert "kept in memory" in capsys.readouterr().err


def test_command_line(tmp_path, capsys, monkeypatch):
    out = str(tmp_path / "a")
    options = ["--quick", "--repeats", "2", "--output", out]
    assert main([FILE, "--list"]) == 0
    assert "explicit Euler" in capsys.readouterr().out
    monkeypatch.setattr(sys, "argv", ["report"])
    assert main(["decay", *options]) == 0
    assert "3 green, 0 amber, 0 red" in capsys.readouterr().out
    baseline = f"{out}/records.jsonl"
    assert main(["decay", *options[:-1], str(tmp_path / "b"), "--baseline", baseline]) == 0
    assert "Against the run of" in (tmp_path / "b" / "report.md").read_text()
    assert main(["no_such"]) == 2
    assert "no scene 'no_such'" in capsys.readouterr().err
    assert main(["decay", "--sweep", "h=1:2:3"]) == 2
    assert "no parameter 'h'; it has 'dt'" in capsys.readouterr().err
    for text in ("dt=1:0:3", "dt", "dt=1:2:x"):
        assert main(["decay", "--sweep", text]) == 2
    Path(baseline).write_text(json.dumps({"schema": 99, "kind": "run"}) + "\n")
    assert main(["decay", "--baseline", baseline]) == 2
    assert "expects schema 1, but got 99" in capsys.readouterr().err


def _curve(errors, dtype="float64"):
    return [
        {"status": "ok", "dtype": dtype, "parameters": {"dt": dt}, "errors": {"x": error}}
        for dt, error in errors
    ]


@pytest.mark.parametrize(
    ("errors", "dtype", "expected"),
    [
        ([(0.1, 1e-2), (0.05, 2.5e-3), (0.025, 6.25e-4)], "float32", 2.0),
        # Round-off of float32 falls and rises by chance.
        ([(0.1, 4e-6), (0.05, 2e-6), (0.025, 1e-6)], "float32", None),
        ([(0.1, 1e-2), (0.05, 1e-7), (0.025, 0.5e-7), (0.0125, 1e-13)], "float64", None),
        # An error that grows as 2^n is no power of n.
        ([(60, 0.29), (30, 8e-9), (15, 5e-12)], "float64", None),
    ],
)
def test_orders_are_not_fitted_through_rounding(errors, dtype, expected):
    assert report.observed_order(_curve(errors, dtype), "dt", "x") == (
        None if expected is None else pytest.approx(expected, abs=0.01)
    )


def test_figures_have_values_and_room():
    figures = pytest.importorskip("warp.report._figures")
    looks = [figures._look(index) for index in range(16)]
    assert len({(look["color"], str(look["linestyle"])) for look in looks}) == 16
    plt = figures.plt
    with plt.rc_context(figures.STYLE):
        figure, panels = figures._panels(2)
        axes = next(panels)
        records = [
            {
                "status": "ok",
                "device": "cpu",
                "dtype": "float64",
                "parameters": {"dt": dt, "method": "a method with a rather long name"},
                "errors": {"x": error},
            }
            for dt, error in ((0.1, 1e-2), (0.05, 1e-3), (0.025, 0.0))
        ]
        curves = report._analysis.curves_of(records, "dt")
        figures._draw_curves(axes, curves, (), "x", lambda record: record["parameters"]["dt"])
        figures._legend(figure, axes)
        text = figures._svg(figure)
        box = figure.legends[0].get_window_extent()
    assert text.count("<title>") >= 2 and "0.001" in text
    # The point without an error lies at the lower edge, inside the figure.
    assert axes.lines[-1].get_ydata()[0] == axes.get_ylim()[0] > 0.0
    assert box.x0 >= 0 and box.x1 <= figure.bbox.width
    assert axes.get_ylabel() == "error of x"


def test_pages_have_heads_contents_and_fit_phones():
    from warp.report._html import make_page

    lines = ["# R", "## a b", "| curve | order |", "|---|---|", "| x | 2 |", "## c"]
    text = make_page("Error against run time", lines, {})
    assert '<th scope="col">curve</th>' in text and "<td>2</td>" in text
    assert '<a href="#a-b">' in text and '<h2 id="a-b">' in text
    assert 'name="viewport"' in text and "aria-sort" in text
    assert "http" not in text


def test_emphasis_is_not_taken_from_products():
    from warp.report._html import make_page

    text = make_page("T", ["*run* is **one** of `a*b*c`", "2 * x * y and x*y*z"])
    assert "<em>run</em> is <strong>one</strong> of <code>a*b*c</code>" in text
    assert "2 * x * y and x*y*z" in text
