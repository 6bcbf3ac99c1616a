"""Comments, docstrings and documents keep to the rules of `scripts/check_language.py`."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[3] / "scripts" / "check_language.py"


def checker():
    spec = importlib.util.spec_from_file_location("check_language", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_repository_keeps_the_rules():
    run = subprocess.run([sys.executable, SCRIPT], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout[-4000:]


@pytest.mark.parametrize(
    "name, text",
    [
        ("a.cpp", "//===- a.cpp - Whether it is ---===//\n"),
        ("a.cpp", "/// Adds two. What\n/// is left stays.\nint x;\n"),
        ("a.cpp", "/// Where a slot is.\nint x;\n"),
        ("a.td", "let description = [{\n  Adds.\n\n  Which one is first.\n}];\n"),
        ("a.py", '"""Of two, the first."""\n'),
        ("a.py", "x = 1  # Those of the block.\n"),
        ("a.py", "# The copy engine moves it.\n"),
        ("a.td", "let description = [{\n  What it is.\n}];\n"),
        ("a.md", "## What it does\n"),
        ("a.sh", "# What it does\n"),
        ("python/bindings/a.cpp", 'm.def("size", size, "Whether it is.");\n'),
    ],
)
def test_broken_rule_is_found(name, text):
    assert list(checker().broken_rules(name, text))


@pytest.mark.parametrize(
    "name, text",
    [
        ("a.cpp", "/// True if it is. The value\n/// of what is left.\nint What;\n"),
        ("a.cpp", "/// The slot of a handle. Where it has none,\n/// zero.\nint x;\n"),
        ("a.py", 'x = "What is it?"\n'),
        ("python/bindings/a.cpp", 'm.def("size", size, "True if it is. What", "what is");\n'),
        ("a.md", "```\nWhat is this code\n```\n"),
    ],
)
def test_kept_rule_is_not_reported(name, text):
    assert not list(checker().broken_rules(name, text))
