"""Calls of builtins with arguments of all kinds: a module or an error at a place, nothing else."""

import linecache
import random

from warp._src.builtin_calls import CALLS

import warp as wp
from warp._src.frontend.build import translate_kernel

PROGRAM = """
import warp as wp

@wp.func
def f(a: float, b: float):
    return a + b

def kernel(a: wp.array(dtype=float), m: wp.array2d(dtype=float), n: int, x: wp.vec3, y: float):
    t = wp.tile_zeros(4, float)
    q = wp.tile_zeros((4, 4), float)
    c = wp.tile_zeros((2, 3), wp.vec2)
    k = wp.tile_stack(4, float)
    {call}
"""
# Arguments that fit a type, and others.
FITTING = {
    **{"tile": ["t", "q", "c", "t[1:3]"], "array": ["a", "m"], "shape": ["4", "(2, 3)"]},
    **{"offsets": ["0", "(n, 1)", "n"], "axis": ["0", "1"], "dtype": ["int", "wp.vec3"]},
    **{"condition": ["True", "n > 2"], "value": ["1.0", "x", "n"], "int": ["n", "0"]},
    **{"stack": ["k"], "const": ["True", "3"], "u32": ["wp.uint32(3)"], "index": ["0", "n"]},
}
ANY = [
    *("a", "m", "n", "x", "y", "t", "q", "c", "k", "-1", "1.5", "None", "'lower'", "()", "(4,)"),
    *("(n, 0)", "float", "wp.vec3", "f", "wp.add", "wp", "slice(0, 2)", "wp.vec3(1.0, 2.0, 3.0)"),
    *("wp.identity(3, float)", "a.shape", "(t, slice(None))"),
]


def argument(rng, type):
    head, *choices = type if isinstance(type, tuple) else (type,)
    fitting = list(map(repr, choices)) if head == "|" else FITTING.get(head, ANY)
    return rng.choice(ANY if rng.random() < 0.15 else fitting)


def random_call(rng, name):
    parameters = rng.choice(CALLS[name])[0]
    by_position, by_name = [], []
    for parameter, type, kind, default in parameters:
        if kind == "*":
            by_position += [argument(rng, type) for _ in range(rng.randint(0, 2))]
        elif by_name or kind == "keyword" or rng.random() < 0.2:
            by_name.append(f"{parameter}={argument(rng, type)}")
        elif default is ... or rng.random() < 0.5:
            by_position.append(argument(rng, type))
    return f"wp.{name}({', '.join(by_position + by_name)})"


def translates(call, path) -> bool:
    """True if a call gives a module, False if an error at its place."""
    path.write_text(PROGRAM.format(call=call))
    linecache.checkcache(str(path))
    space = {}
    exec(compile(path.read_text(), path, "exec"), space)
    try:
        translate_kernel(wp.Kernel(space["kernel"]))
    except wp.WarpCodegenError as problem:
        assert "program.py:13:" in str(problem), f"{call}: {problem}"
        return False
    return True


def test_random_calls(tmp_path):
    rng = random.Random(1)
    calls = [random_call(rng, name) for name in CALLS for _ in range(12)]
    accepted = [call for call in calls if translates(call, tmp_path / "program.py")]
    # Not all of the same few builtins.
    assert len({call.partition("(")[0] for call in accepted}) > len(CALLS) // 2
