"""Reports against another package: here this one again, by an interpreter that a script starts."""

import os
import sys
from pathlib import Path

import pytest

import warp as wp
import warp.report as report
from warp.report._scene import registered
from warp.report._worker import load

FILE = str(Path(__file__).parent / "scenes_for_tests.py")
load(FILE)


def interpreter(folder, text):
    path = folder / "python"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


def run(name, folder, against):
    options = {"limit": 60.0, "repeats": 3, "budget": 0.02, "output": folder / "pages"}
    return report.run([registered()[name]], against=str(against), **options)


def test_points_are_measured_by_the_other_interpreter(tmp_path):
    """The same code in another process gives the same bits, so that errors are the same."""
    place = Path(wp.__file__).parents[1]
    marker = tmp_path / "started"
    other = interpreter(
        tmp_path, f'echo x >> {marker}\nPYTHONPATH={place} exec "{sys.executable}" "$@"'
    )
    records = run("decay", tmp_path, other)
    assert marker.read_text() == "x\n"
    assert len(records) > 2
    for record in records:
        assert record["peer"]["status"] == "ok"
        assert record["peer"]["errors"] == record["errors"]
        assert record["peer"]["seconds"]["median"] > 0.0
    text = (tmp_path / "pages" / "report.md").read_text()
    assert "| curve | points | time | peer | peer / own | error | error of the peer |" in text
    assert f"{len(records)} of {len(records)}" in text
    assert "of the peer have no result" not in text


@pytest.mark.parametrize(
    "text, reason",
    [
        ('echo "no such package" >&2; exit 3', "no such package"),
        (f'exec "{sys.executable}" -I -c "import sys; print(1, flush=True); sys.exit(0)"', None),
    ],
    ids=["not-started", "dies"],
)
def test_a_peer_without_an_answer_is_named(tmp_path, text, reason):
    """This package's records are unchanged, and the page says why there is no ratio."""
    records = run("decay", tmp_path, interpreter(tmp_path, text))
    assert {r["status"] for r in records} == {"ok"} and {r["verdict"] for r in records} == {"green"}
    assert {r["peer"]["status"] for r in records} == {"failed"}
    shown = reason or "took its process down"
    assert all(shown in r["peer"]["reason"] for r in records)
    page = (tmp_path / "pages" / "report.md").read_text()
    assert "The peer has no point with a result." in page and shown in page


def test_an_interpreter_that_is_not_there_is_named(tmp_path):
    missing = os.fspath(tmp_path / "nowhere")
    records = run("decay", tmp_path, missing)
    assert records[0]["peer"]["reason"] == f"cannot run '{missing}': No such file or directory"
