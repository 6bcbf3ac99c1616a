"""Files of test/Transforms bear the name of the pass that they test."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
TESTS = sorted((ROOT / "test" / "Transforms").glob("*.mlir"))
FLAGS = {
    flag
    for name in ("Passes.td", "TilePasses.td")
    for flag in re.findall(
        r'Pass<"warp-([a-z0-9-]+)"', (ROOT / "include" / "WarpDialect" / name).read_text()
    )
}


def flag_of(name: str) -> str | None:
    """The longest flag that a file's name begins with."""
    matching = [flag for flag in FLAGS if name == flag or name.startswith(flag + "-")]
    return max(matching, key=len, default=None)


@pytest.mark.parametrize("test", TESTS, ids=lambda test: test.stem)
def test_file_is_named_after_its_pass(test):
    """The name begins with a pass's flag, and a RUN line runs that pass or a whole pipeline."""
    flag = flag_of(test.stem)
    assert flag, f"'{test.stem}' begins with no pass's flag"
    runs = "".join(re.findall(r"// RUN:.*", test.read_text()))
    assert re.search(rf"-warp-({flag}|pipeline)\b", runs)


def test_every_pass_has_a_test():
    assert FLAGS == {flag_of(test.stem) for test in TESTS if flag_of(test.stem)}
