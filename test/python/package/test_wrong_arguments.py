"""All that the package offers, called with wrong arguments: an answer or a clear error."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.argument_walk import judge
from support.random_runs import seeds

import warp as wp
from warp.extend import checked, errors, shown
from warp.extend.kinds import COUNT, FLAG, NUMBER, PATH, POINT

# Calls of each function, method, operator and setter.
CALLS = 3
# Calls are made in forked processes of little memory. A process that uses CUDA cannot be forked,
# and other libraries do not end well where memory does, so there are none.
WALK = """
import json, sys, warnings
sys.modules.update(dict.fromkeys(("jax", "paddle", "torch")))
from support.argument_walk import targets, walk
warnings.simplefilter("ignore")
found = walk.walk(targets.targets(), *map(int, sys.argv[1:]))
print("\\n" + json.dumps(found))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="calls are made in forked processes")
@pytest.mark.parametrize("seed", seeds(1))
def test_wrong_arguments_have_clear_errors(seed, tmp_path):
    """No call crashes, hangs, or ends in an error that Python raised inside of the package."""
    paths = [str(Path(wp.__file__).parents[1].resolve()), str(Path(judge.__file__).parents[2])]
    ended = subprocess.run(
        [sys.executable, "-c", WALK, str(seed), str(CALLS)],
        cwd=tmp_path,
        env=os.environ | {"CUDA_VISIBLE_DEVICES": "", "PYTHONPATH": os.pathsep.join(paths)},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr[-4000:]
    failures, count = json.loads(ended.stdout.splitlines()[-1])
    assert count > 9_000
    shown = "\n".join(f"{call}\n    {what}" for call, what in failures)
    assert not failures, f"{len(failures)} of {count} calls:\n{shown}"


def test_the_judge_knows_accidents():
    """Errors of Python from inside are accidents; those that the package raises are answers."""
    wanted = {
        lambda: wp.zeros(3, device="cpu").fill_("x"): None,
        lambda: wp.vec3(1.0, "x", 2.0): None,
        lambda: wp.zeros(no_such=1): None,
        lambda: wp._src.types.dtypes.native_text.__wrapped__: "AttributeError",
        lambda: wp._src.arrays.layout.bytes_spanned(None): "AttributeError",
        lambda: wp._src.types.arithmetic.half_to_bits(None): "TypeError",
        lambda: wp._src.kernels.modules.OPTIONS["x"]: "KeyError",
    }
    for call, accident in wanted.items():
        with pytest.raises(Exception) as caught:
            call()
        problem = judge.problem(caught.value)
        assert (accident is None) == (problem is None), problem
        assert accident is None or accident in problem


@checked(size=COUNT, factor=NUMBER, center=POINT, folder=PATH, loud=FLAG)
def public(size, factor=None, center=(0, 0, 0), folder=".", loud=False, device=None):
    """Fails whatever it is given, unless the size is 1."""
    if size == 1:
        raise ValueError("the package's own words")
    return {}["no such key"]


public.__wrapped__.__module__ = "warp._src.utils.public"


@pytest.mark.parametrize(
    "given, words",
    [
        ({"size": "4"}, "argument 'size' expects an integer of at least 0, but got '4'"),
        ({"size": -1}, "expects an integer of at least 0, but got '-1'"),
        ({"size": True}, "but got 'True'"),
        ({"size": 4, "factor": float("nan")}, "'factor' expects a finite number, but got 'nan'"),
        ({"size": 4, "center": (1, 2)}, "'center' expects three numbers, but got 'tuple'"),
        ({"size": 4, "folder": "a\0b"}, "'folder' expects a path"),
        ({"size": 4, "loud": []}, "'loud' expects True or False, but got 'list'"),
        ({"size": 4, "device": "gpu"}, "'device' expects a device, such as 'cpu'"),
        ({"size": wp.vec3}, "but got the type 'vec3f'"),
        ({}, "missing a required argument: 'size'"),
        ({"size": 4, "no_such": 1}, "unexpected keyword argument 'no_such'"),
    ],
)
def test_a_failed_call_names_the_wrong_argument(given, words):
    """The message has the function as users write it, the argument, and both sides."""
    with pytest.raises(errors.WarpArgumentError) as caught:
        public(**given)
    assert str(caught.value).startswith("wp.utils.public(): ")
    assert words in str(caught.value)
    assert isinstance(caught.value, (TypeError, ValueError))


def test_other_errors_stay_as_they_are():
    """With all arguments right the failure is not hidden; own words are not replaced."""
    with pytest.raises(KeyError, match="no such key"):
        public(4)
    with pytest.raises(ValueError, match="the package's own words"):
        public(1)


def test_values_in_messages_are_short():
    """A message repeats short numbers and strings, and names the type of all else."""
    circle = []
    circle.append(circle)
    assert [shown(value) for value in (3, "a", circle, "a" * 99, 10**5000, wp.vec3())] == [
        *("'3'", "'a'", "'list'", "'str'", "'int'", "'vec3f'"),
    ]
