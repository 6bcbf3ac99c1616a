"""Sentences of NVIDIA Warp in messages: by codes of errors, and only where they are asked for."""

import ast
import pickle
from pathlib import Path

import pytest

import programs
import warp as wp
from warp._src.compat import peer_messages
from warp.extend import errors

ROOT = Path(wp.__file__).parent / "_src"
# Codes that the binding of launch arguments gives (Pack.cpp).
NATIVE = {"launch-argument", "launch-conversion"}


def codes_in(tree) -> set:
    """Texts that are given as `code`, in calls of any function."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg == "code":
            found |= {one.value for one in ast.walk(node.value) if isinstance(one, ast.Constant)}
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "coded" and node.args:
            found |= {getattr(node.args[0], "value", None)}
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "code":
            found |= {one.value for one in ast.walk(node.value) if isinstance(one, ast.Constant)}
    return {one for one in found if isinstance(one, str)}


def test_every_sentence_has_a_place_and_every_code_a_sentence():
    texts = [path.read_text("utf-8") for path in sorted(ROOT.rglob("*.py"))]
    used = set().union(*(codes_in(ast.parse(text)) for text in texts))
    known = set(peer_messages.SENTENCES)
    assert known - used - NATIVE == {"overwritten"}
    # Other uses of the word are of strings that are no codes.
    assert {one for one in used if "-" in one} <= known


def test_sentences_are_shown_where_they_are_asked_for(monkeypatch):
    with pytest.raises(ValueError) as caught:
        wp.zeros(-1, device="cpu")
    error = caught.value
    ours = "expects extents of at least 0, but got -1 in dimension 0"
    assert str(error) == ours and error.code == "extent-negative"
    monkeypatch.setattr(wp.config, "peer_messages", True)
    assert str(error) == f"{ours}\nas Warp says: Array shapes must be non-negative"
    monkeypatch.setattr(wp.config, "peer_messages", False)
    assert str(error) == ours


@wp.kernel
def write_at_a_float(points: wp.array[wp.vec3]):
    points[0.0].x = 1.0


@wp.kernel
def add_at_a_float(points: wp.array[wp.vec3]):
    points[0.0].x += 1.0


@pytest.mark.parametrize("kernel", [write_at_a_float, add_at_a_float])
def test_indices_of_components(monkeypatch, kernel):
    monkeypatch.setattr(wp.config, "peer_messages", True)
    with pytest.raises(TypeError, match="must be an integer, but got 'float32'") as caught:
        wp.launch(kernel, 1, [wp.zeros(1, dtype=wp.vec3, device="cpu")], device="cpu")
    assert str(caught.value).endswith("Array slot write indices must be integers or slices")


def test_the_environment_asks_for_them():
    program = programs.write_program("import warp as wp\nwp.zeros(-1)\n")
    for value, shown in (("1", True), ("0", False)):
        _, _, said = programs.run(program, WARP_PEER_MESSAGES=value)
        assert ("as Warp says" in said) == shown


def test_errors_from_other_processes_keep_their_code(monkeypatch):
    monkeypatch.setattr(wp.config, "peer_messages", True)
    error = errors.WarpTypeError("ours", code="external-reference", facts={"kind": int})
    assert str(error).endswith("Invalid external reference type: <class 'int'>")
    again = pickle.loads(pickle.dumps(error))
    assert (again.code, str(again)) == ("external-reference", "ours")


@pytest.mark.parametrize(
    ("code", "ours", "peers"),
    [
        (
            "argument",
            "'array(ndim=1, dtype=float32)', but got 'None'",
            "argument 'x' expects an array of type array(ndim=1, dtype=float32), but passed value "
            "has type "
            "NoneType",
        ),
        (
            "argument",
            "'array(ndim=1, dtype=float32)', but got 'array(ndim=2, dtype=float32)' on 'cpu'",
            "argument 'x' expects an array with 1 dimension(s) but the passed array has 2 "
            "dimension(s)",
        ),
        (
            "argument",
            "'array(ndim=1, dtype=float32)', but got 'array(ndim=1, dtype=int32)' on 'cpu'",
            "argument 'x' expects an array with dtype=float32 but passed array has dtype=int32",
        ),
        (
            "argument",
            "'array(ndim=1, dtype=float32)', but got '3' ('int')",
            "argument 'x' expects an array of type array(ndim=1, dtype=float32), but passed value "
            "has type "
            "int",
        ),
        (
            "argument",
            "'vec3f', but got '3' ('int')",
            "argument 'x' expects vec3f but got a single value",
        ),
        ("argument", "'Pair', but got 'None'", "argument 'x' expects Pair but got None"),
        ("conversion", "'int32', but got 'str'", "Failed to convert argument for param x to int32"),
    ],
)
def test_launch_arguments(monkeypatch, code, ours, peers):
    monkeypatch.setattr(wp.config, "peer_messages", True)
    message = f"launch('k'): argument 'x' expects {ours}"
    error = errors.from_native("launchtype", f"{message}\ncode: launch-{code}")
    assert str(error) == f"{message}\nas Warp says: {peers}"
    assert isinstance(error, TypeError)
    assert isinstance(error, ValueError) == (code == "conversion")
