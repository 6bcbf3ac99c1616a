"""A kernel inside a JAX program: waves on several membranes at once.

The stencil is a kernel; `jax.lax.fori_loop` steps it, `jax.vmap` runs several membranes with
different initial states, and `jax.jit` makes one program of everything.

    python examples/jax_wave.py [--steps 400]
"""

import argparse
import sys

try:
    import jax
    import jax.numpy as jnp
except ModuleNotFoundError:
    print("skipped: this example needs JAX")
    sys.exit()

import warp as wp


@wp.kernel
def step(
    now: wp.array2d[float],
    before: wp.array2d[float],
    speed: float,
    after: wp.array2d[float],
):
    i, j = wp.tid()
    rows = now.shape[0]
    columns = now.shape[1]
    if i == 0 or j == 0 or i == rows - 1 or j == columns - 1:
        after[i, j] = 0.0
        return
    curvature = now[i - 1, j] + now[i + 1, j] + now[i, j - 1] + now[i, j + 1] - 4.0 * now[i, j]
    after[i, j] = 2.0 * now[i, j] - before[i, j] + speed * curvature


advance = wp.jax_kernel(step)


def simulate(start: jax.Array, steps: int) -> jax.Array:
    def body(_, state):
        now, before = state
        return advance(now, before, 0.25)[0], now

    return jax.lax.fori_loop(0, steps, body, (start, start))[0]


def main(size: int, count: int, steps: int) -> jax.Array:
    y, x = jnp.mgrid[0:size, 0:size] / size
    centres = jnp.linspace(0.3, 0.7, count)
    starts = jnp.exp(-200.0 * ((x - centres[:, None, None]) ** 2 + (y - 0.5) ** 2))
    run = jax.jit(jax.vmap(simulate, in_axes=(0, None)), static_argnums=1)
    result = run(starts.astype(jnp.float32), steps)
    for centre, membrane in zip(centres, result, strict=True):
        print(
            f"bump at {centre:.2f}: height now between {membrane.min():.3f}, {membrane.max():.3f}"
        )
    return result


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--count", type=int, default=4)
    parser.add_argument("--steps", type=int, default=400)
    options = parser.parse_args()
    main(options.size, options.count, options.steps)
