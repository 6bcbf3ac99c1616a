"""`wp.ScopedTimer(use_nvtx=True)`: ranges of the package nvtx, with a stand-in that takes notes."""

import sys
import types

import pytest

import warp as wp


@pytest.fixture
def events(monkeypatch):
    found = []

    def start_range(message=None, color=None):
        found.append(("start", message, color))
        return len(found)

    nvtx = types.ModuleType("nvtx")
    nvtx.start_range = start_range
    nvtx.end_range = lambda number: found.append(("end", number))
    monkeypatch.setitem(sys.modules, "nvtx", nvtx)
    return found


def test_ranges_nest_and_end(events, capsys):
    """The outer range begins first and ends last; times are printed as without ranges."""
    with wp.ScopedTimer("outer", use_nvtx=True, color="red", synchronize=True) as timer:
        with wp.ScopedTimer("inner", use_nvtx=True, print=False):
            pass
    assert events == [
        ("start", "outer", "red"),
        ("start", "inner", "rapids"),
        ("end", 2),
        ("end", 1),
    ]
    assert timer.elapsed > 0.0 and "outer took" in capsys.readouterr().out


@pytest.mark.parametrize("source", ["block", "device"])
def test_range_ends_with_an_error(events, monkeypatch, source):
    def failing():
        raise wp.WarpError("the device does not answer")

    with pytest.raises((ValueError, wp.WarpError)):
        with wp.ScopedTimer("work", use_nvtx=True, print=False, synchronize=True):
            if source == "block":
                raise ValueError
            monkeypatch.setattr("warp._src.devices.devices.synchronize", failing)
    monkeypatch.undo()
    assert [one[0] for one in events] == ["start", "end"]


def test_no_range_unless_asked(events):
    with wp.ScopedTimer("a", print=False), wp.ScopedTimer("b", active=False, use_nvtx=True):
        pass
    assert events == []


def test_missing_package_is_named(monkeypatch):
    """A timer that is not active needs no package; one that is says how to get it."""
    monkeypatch.setitem(sys.modules, "nvtx", None)
    depth = wp.ScopedTimer.indent
    with wp.ScopedTimer("a", use_nvtx=True, active=False):
        pass
    with pytest.raises(ModuleNotFoundError, match="`use_nvtx`.*pip install nvtx"):
        with wp.ScopedTimer("a", use_nvtx=True):
            pass
    assert wp.ScopedTimer.indent == depth


def test_package():
    pytest.importorskip("nvtx")
    with wp.ScopedTimer("a", use_nvtx=True, print=False) as timer:
        pass
    assert timer.elapsed > 0.0
