"""`jax.shard_map` over four devices: values, derivatives, and what JAX must refuse."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

NAMES = """kernel|replicated|mixed inputs|mixed inputs of a callable|constant|constant of NumPy
in-out, mixed|scan|cond|axis of two|inputs over different axes|vmap|grad of split input
grad of replicated input|grad inside|value and grad of a mean|grad of scan|grad, vmap
grad beside integers|kernel, P()|callable, P()|grad, P()""".replace("\n", "|").split("|")


@pytest.fixture(scope="module")
def outcomes():
    pytest.importorskip("jax")
    program = Path(__file__).with_name("jax_shard_cases.py")
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("name", NAMES)
def test_case(outcomes, name):
    """Results vary over the axes of the mesh that the inputs vary over, and JAX knows it."""
    if outcomes[name] == "plain JAX fails":
        pytest.skip("this JAX has no derivatives of sums inside of shard_map")
    assert outcomes[name] == "right"


def test_all_cases_are_named(outcomes):
    assert list(outcomes) == NAMES
