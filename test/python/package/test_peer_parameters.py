"""Public functions take the arguments of NVIDIA Warp's, by their names and in their order."""

import functools
import importlib
import inspect
from pathlib import Path

import pytest

ROWS = [
    line.split(": ")
    for line in Path(__file__).with_name("peer_parameters.txt").read_text().splitlines()
    if not line.startswith("#")
]
# Made by the package alone, or by names that are checked when it is called.
OTHERWISE = {
    "warp.Texture1D": "test/python/textures",
    "warp.Texture2D": "test/python/textures",
    "warp.Texture3D": "test/python/textures",
    "warp.kernel": "options that change nothing are taken as keywords",
}
# Parameters that every keyword of which is passed on.
PASSED_ON = (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)


def found(path):
    parts = path.split(".")
    for length in range(len(parts), 0, -1):
        try:
            module = importlib.import_module(".".join(parts[:length]))
        except ModuleNotFoundError:
            continue
        return functools.reduce(getattr, parts[length:], module)
    raise AssertionError(path)


@pytest.mark.parametrize("path, names", ROWS, ids=[row[0] for row in ROWS])
def test_parameters(path, names):
    function = found(path)
    if path in OTHERWISE:
        return
    try:
        signature = inspect.signature(function)
    except ValueError:
        # Native methods say what they take in their text.
        shown = getattr(function, "__doc__", "") or ""
        assert all(name in shown for name in names.split()), shown
        return
    names = names.split()
    given = [name for name in signature.parameters if name != "self"]
    if any(one.kind in PASSED_ON for one in signature.parameters.values()):
        given += [name for name in names if name not in given]
    assert [name for name in names if name not in given] == []
    positional = [
        name
        for name, one in signature.parameters.items()
        if name in names and one.kind is not inspect.Parameter.KEYWORD_ONLY
    ]
    assert positional == [name for name in names if name in positional]
