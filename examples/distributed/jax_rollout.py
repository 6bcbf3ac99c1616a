"""Worlds split over JAX's devices: kernels in `shard_map`, gradients of the mean cost.

    python examples/distributed/jax_rollout.py [--worlds 512 --iterations 30 --devices 4]

JAX splits and sums; a kernel sees the worlds of its device alone. A result varies over each axis of
the mesh that an input varies over, so gradients of the shared gains are summed by JAX.
"""

# The package is imported where a process begins to use it.
# pyright: reportInvalidTypeForm=false
# mypy: disable-error-code="name-defined"

import argparse
import importlib
import os
from pathlib import Path

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    for name, value in (("worlds", 512), ("iterations", 30), ("devices", 4)):
        parser.add_argument(f"--{name}", type=int, default=value)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    flag = f"--xla_force_host_platform_device_count={options.devices}"
    os.environ["XLA_FLAGS"] = f"{os.environ.get('XLA_FLAGS', '')} {flag}"
    import jax
    import jax.numpy as jnp
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np
    from jax.sharding import Mesh
    from jax.sharding import PartitionSpec as P

    import warp as wp

    wp.config.quiet = True
    mesh = Mesh(np.array(jax.devices()), ("worlds",))
    roll_out = wp.jax_kernel(make_kernel(wp), enable_backward=True)

    def cost(gains, x, v):
        # Each world has its row of gains; JAX sums their derivatives.
        shared = jnp.broadcast_to(gains, (x.shape[0], 2))
        (total,) = roll_out(x, v, shared[:, 0], shared[:, 1])
        return jax.lax.pmean(jnp.mean(total), "worlds")

    if hasattr(jax, "shard_map"):
        shard_map = jax.shard_map
    else:  # JAX 0.6.0, the oldest that is supported
        shard_map = importlib.import_module("jax.experimental.shard_map").shard_map
    split = shard_map(cost, mesh=mesh, in_specs=(P(), P("worlds"), P("worlds")), out_specs=P())
    step = jax.jit(jax.value_and_grad(split))
    rng = np.random.default_rng(0)
    x, v = (jnp.asarray(rng.standard_normal(options.worlds), jnp.float32) for _ in range(2))
    gains, losses = jnp.array([0.2, 0.0]), []
    for _ in range(options.iterations):
        loss, gradient = step(gains, x, v)
        gains = gains - 0.5 * gradient
        losses.append(float(loss))
    options.output.mkdir(parents=True, exist_ok=True)
    plt.plot(losses)
    plt.xlabel("iteration")
    plt.ylabel("mean cost")
    plt.title(f"{options.worlds} worlds on {len(jax.devices())} JAX devices")
    plt.savefig(options.output / "jax_rollout.png", dpi=110, bbox_inches="tight")
    print(f"{len(jax.devices())} devices: cost {losses[0]:.4f} to {losses[-1]:.4f}, gains {gains}")


def make_kernel(wp):
    """A cart with a spring-damper policy; the cost is squared distance and effort."""

    @wp.kernel
    def roll_out(
        x0: wp.array[float],
        v0: wp.array[float],
        p: wp.array[float],
        d: wp.array[float],
        cost: wp.array[float],
    ):
        i = wp.tid()
        x = x0[i]
        v = v0[i]
        total = float(0.0)
        for _ in range(60):
            u = -p[i] * x - d[i] * v
            v = v + 0.05 * u
            x = x + 0.05 * v
            total = total + 0.05 * (x * x + 0.05 * u * u)
        cost[i] = total

    return roll_out


if __name__ == "__main__":
    main()
