"""Programs by JAX: the formulas of `_programs`, compiled as a whole."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from _programs import PROGRAMS as FORMULAS
from _programs import Arrays
from packages import Run

VERSION = f"jax {jax.__version__}"
# Formulas of all programs, by name; counts of steps are known when they are compiled.
PROGRAMS = FORMULAS
STATIC = ("steps", "most", "bins", "side")


class JaxArrays(Arrays):
    xp = jnp

    def add_at(self, count, index, values):
        return jnp.zeros((count, *values.shape[1:]), values.dtype).at[index].add(values)

    def repeat(self, steps, function, state):
        # A scan, since loops without a fixed count have no adjoint.
        return jax.lax.scan(lambda state, _: (function(state), None), state, length=steps)[0]


def build(name, inputs, weights, device):
    place = jax.devices("cpu" if device == "cpu" else "cuda")[0]
    wrt = FORMULAS[name].wrt
    fixed = {key: value for key, value in inputs.items() if key in STATIC}
    given = {key: value for key, value in inputs.items() if key not in STATIC}
    given = {
        key: jax.device_put(value, place) if isinstance(value, np.ndarray) else np.float32(value)
        for key, value in given.items()
    }
    function = functools.partial(FORMULAS[name].formula, JaxArrays(), **fixed)
    compiled = jax.jit(lambda given: function(**given))
    held = {}

    def forward():
        held["result"] = jax.block_until_ready(compiled(given))

    if weights is None:
        return Run(forward, lambda: np.asarray(held["result"]))
    weights = jax.device_put(weights, place)

    @jax.jit
    def both(given, weights):
        result, pull = jax.vjp(lambda x: function(**{**given, wrt: x}), given[wrt])
        return result, pull(weights)[0]

    def backward():
        held["result"], held["gradient"] = jax.block_until_ready(both(given, weights))

    return Run(
        forward,
        lambda: np.asarray(held["result"]),
        backward,
        lambda: np.asarray(held["gradient"]),
    )
