"""The catalogue of stability: its verdicts, its pages, and cases that must stay within limits."""

import json

import numpy as np
import pytest

import warp as wp
import warp.report.stability.__main__ as command
from warp.report.__main__ import main
from warp.report.stability._case import Probe, case, expand, registered, run_case
from warp.report.stability._pages import reproducer

command.prepare("cpu")


@wp.func
def naive_length(v: wp.vec2):
    return wp.sqrt(v[0] * v[0] + v[1] * v[1])


@pytest.fixture
def broken():
    """A case whose function overflows."""

    @case("R99", "a naive length", ("float32",))
    def overflows(p):
        v = np.array([(3, 4), (3e19, 4e19), (0, 1)], np.float32)
        found = p.map(naive_length, p.array(v, wp.vec2))
        p.check("length", found / np.hypot(*v.T.astype(float)) - 1, 2 * p.u, v=v)

    yield "R99"
    del registered()["R99"]


def test_a_wrong_result_fails_with_its_worst_input(broken):
    (record,) = run_case(broken, "cpu")
    assert record["verdict"] == "fail"
    text = "\n".join(reproducer(record))
    operand = np.float32([3e19, 4e19]).tolist()
    assert f"v = {operand}" in text and "error inf" in text
    assert "python -m warp.report stability R99" in text


def test_an_exception_is_a_failure_that_says_where():
    @case("R98", "raises")
    def raises(p):
        p.array([1.0]).numpy()[7]

    (record,) = run_case("R98", "cpu")
    del registered()["R98"]
    assert record["verdict"] == "fail"
    assert "IndexError" in record["checks"][0]["text"] and ".py:" in record["checks"][0]["text"]


def test_verdicts_of_checks():
    p = Probe("cpu", "float64")
    p.check("nan", [0.0, np.nan], 1.0)
    p.diagnosed("refused", lambda: wp.zeros(-1), "-1")
    p.diagnosed("silent", lambda: None, "word")
    p.holds("false", [True, False])
    assert [c["verdict"] for c in p.checks] == ["fail", "diagnosed", "fail", "fail"]
    assert p.absent("RegisteredGLBuffer") and not p.absent("Mesh")
    assert not p.absent("intersect_tri_tri") and not p.absent("closest_point_edge_edge")


def test_names_of_cases():
    assert expand(["R13"]) == ["R13"] and len(expand(["N"])) > 8
    assert expand(["D1-D3"]) == ["D1", "D2", "D3"]
    with pytest.raises(ValueError, match="no case 'Z9'"):
        expand(["Z9"])
    sections = {name[0] for name in expand([])}
    assert sections == set("DFGRNSL")


def test_command_writes_pages_and_counts(tmp_path, capsys):
    assert main(["stability", "R13", "S6", "--output", str(tmp_path)]) == 0
    assert "3 pass, 0 diagnosed, 0 absent, 0 fail" in capsys.readouterr().out
    lines = (tmp_path / "stability.jsonl").read_text().splitlines()
    assert [json.loads(line)["case"] for line in lines[1:]] == ["R13", "R13", "S6"]
    assert (
        "| R: rotations and small dense matrices | 2 |" in (tmp_path / "stability.md").read_text()
    )
    assert main(["stability", "Q"]) == 2


def test_interrupted_and_full_disk_keep_what_was_found(tmp_path, capsys, monkeypatch):
    def interrupt(remote, name):
        if name == "R15":
            raise KeyboardInterrupt
        return run_case(name, "cpu")

    monkeypatch.setattr("warp.report._remote.Remote.ask", interrupt)
    assert main(["stability", "R13", "R15", "--output", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "interrupted" in said.err and "2 pass" in said.out
    assert len((tmp_path / "stability.jsonl").read_text().splitlines()) == 3
    for page in ("stability.jsonl", "stability.md"):
        (tmp_path / page).unlink()
        (tmp_path / page).symlink_to("/dev/full")
    assert main(["stability", "R13", "--output", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert said.err.count("No space left") == 2 and "2 pass" in said.out


NAMES = ["N1", "N6", "N9", "N11", "R2", "R7", "R15", "G1", "G3", "D1", "F13", "F14", "F15"]


@pytest.mark.parametrize("name", NAMES)
def test_cases_of_the_catalogue(name):
    for record in run_case(name, "cpu"):
        assert record["verdict"] in ("pass", "diagnosed"), reproducer(record)
