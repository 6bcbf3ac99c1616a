"""Programs of `jax.shard_map` over four devices of the CPU, for test_interop_jax_shards.py.

Run as a program, since the number of devices has to be said before JAX is imported: prints a line
of JSON with `right`, or what was wrong, by name of the case.
"""

import json
import os

os.environ["XLA_FLAGS"] = "--xla_force_host_platform_device_count=4"
os.environ["JAX_PLATFORMS"] = "cpu"

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh
from jax.sharding import PartitionSpec as P

import warp as wp


@wp.kernel
def square(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]


@wp.kernel
def weigh(x: wp.array(dtype=float), w: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * w[i % w.shape[0]]


@wp.kernel
def pick(x: wp.array(dtype=float), k: wp.array(dtype=int), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[k[i]]


@wp.kernel
def add(total: wp.array(dtype=float), x: wp.array(dtype=float)):
    i = wp.tid()
    total[i] = total[i] + x[i]


def weigh_called(x: wp.array(dtype=float), w: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.launch(weigh, x.shape, [x, w, y])


squared = wp.jax_kernel(square, enable_backward=True)
weighed = wp.jax_kernel(weigh, enable_backward=True)
called = wp.jax_callable(weigh_called)
added = wp.jax_kernel(add, in_out_argnames=["total"])
picked = wp.jax_kernel(pick, enable_backward=True)

N = np.arange(1.0, 17.0)
X, W = jnp.asarray(N, jnp.float32), jnp.array([2.0, 3.0], jnp.float32)
WEIGHED = N * np.tile([2.0, 3.0], 8)
NEIGHBOURS = jnp.tile(jnp.array([1, 0, 3, 2], jnp.int32), 4)
# Derivatives of the sum of what is weighed.
OF_W = np.array([N[0::2].sum(), N[1::2].sum()])
LINE = Mesh(np.array(jax.devices()), ("i",))
GRID = Mesh(np.array(jax.devices()).reshape(2, 2), ("a", "b"))
BOTH = (P("i"), P())


if hasattr(jax, "shard_map"):
    shard_map = jax.shard_map
else:
    # JAX 0.6.0, the oldest that is supported.
    from jax.experimental.shard_map import shard_map


def over(f, inputs=P("i"), outputs=P("i"), mesh=LINE, **options):
    return shard_map(f, mesh=mesh, in_specs=inputs, out_specs=outputs, **options)


def total(f):
    return lambda *arrays: f(*arrays).sum()


def twice(x):
    return jax.lax.scan(lambda c, _: (squared(c)[0], None), x, None, length=2)[0]


def inside(x, w):
    """The loss of data-parallel training: one value with a copy on each device."""
    return jax.value_and_grad(lambda w: jax.lax.pmean((weighed(x, w)[0] ** 2).mean(), "i"))(w)


weigh_over = over(lambda x, w: weighed(x, w)[0], BOTH)
CASES = {
    "kernel": lambda: (over(lambda x: squared(x)[0])(X), N**2),
    "replicated": lambda: (over(lambda w: squared(w)[0], P(), P())(W), np.array([4.0, 9.0])),
    "mixed inputs": lambda: (weigh_over(X, W), WEIGHED),
    "mixed inputs of a callable": lambda: (over(lambda x, w: called(x, w)[0], BOTH)(X, W), WEIGHED),
    "constant": lambda: (over(lambda x: weighed(x, W)[0])(X), WEIGHED),
    "constant of NumPy": lambda: (over(lambda x: weighed(x, np.asarray(W))[0])(X), WEIGHED),
    "in-out, mixed": lambda: (
        over(lambda t, x: added(t, x)[0], (P(), P("i")))(jnp.ones(4, jnp.float32), X),
        N + 1.0,
    ),
    "scan": lambda: (over(twice)(X / 16), (N / 16) ** 4),
    "cond": lambda: (
        over(lambda x: jax.lax.cond(x[0] > 5, lambda x: squared(x)[0], lambda x: x * x, x))(X),
        N**2,
    ),
    "axis of two": lambda: (over(lambda x: squared(x)[0], P("a"), P("a"), GRID)(X), N**2),
    "inputs over different axes": lambda: (
        over(lambda x, w: weighed(x, w)[0], (P("a"), P("b")), P(("b", "a")), GRID)(X, W),
        np.concatenate([2.0 * N, 3.0 * N]),
    ),
    "vmap": lambda: (
        over(lambda x, w: jax.vmap(lambda w: weighed(x, w)[0])(w), BOTH, P(None, "i"))(
            X, jnp.stack([W, W + 1.0])
        ),
        np.stack([WEIGHED, WEIGHED + N]),
    ),
    "grad of split input": lambda: (jax.grad(total(weigh_over))(X, W), np.tile([2.0, 3.0], 8)),
    "grad of replicated input": lambda: (jax.grad(total(weigh_over), 1)(X, W), OF_W),
    "grad inside": lambda: (
        over(lambda x: jax.grad(lambda x: jax.lax.psum(squared(x)[0].sum(), "i"))(x))(X),
        2.0 * N,
    ),
    "value and grad of a mean": lambda: (
        np.hstack(over(inside, BOTH, (P(), P()))(X, W)),
        np.hstack([(WEIGHED**2).mean(), 0.25 * (N[0::2] ** 2).sum(), 0.375 * (N[1::2] ** 2).sum()]),
    ),
    "grad of scan": lambda: (jax.grad(total(over(twice)))(X / 16), 4.0 * (N / 16) ** 3),
    "grad, vmap": lambda: (
        over(jax.vmap(jax.grad(lambda x: squared(x)[0].sum())))(X.reshape(4, 4)).reshape(-1),
        2.0 * N,
    ),
    "grad beside integers": lambda: (
        jax.grad(
            lambda x: over(lambda x, k: picked(x, k)[0], (P("i"), P("i")))(x, NEIGHBOURS).sum()
        )(X),
        2.0 * N.reshape(-1, 2)[:, ::-1].reshape(-1),
    ),
}
# JAX refuses results that differ from device to device where one for all is promised.
WRONG = {
    "kernel, P()": lambda: over(lambda x: squared(x)[0], P("i"), P())(X),
    "callable, P()": lambda: over(lambda x: called(x, W)[0], P("i"), P())(X),
    "grad, P()": lambda: over(jax.grad(lambda x: squared(x)[0].sum()), P("i"), P())(X),
}


# Cases whose derivative of a sum on each device JAX 0.6.0 refuses without kernels, too.
INSIDE = ("grad, vmap", "grad, P()")


def differentiates_inside():
    """True if this JAX differentiates sums inside of shard_map."""
    try:
        over(jax.grad(lambda x: (x * x).sum()))(X)
        return True
    except ValueError:
        return False


def outcome(case):
    try:
        got, wanted = case()
        np.testing.assert_allclose(np.asarray(got), wanted, rtol=1e-5)
        return "right"
    except Exception as problem:
        return f"{type(problem).__name__}: {problem}"


def refusal(case):
    try:
        return f"accepted: {case()}"
    except ValueError as problem:
        return "right" if "out_specs" in str(problem) else str(problem)


if __name__ == "__main__":
    found = {name: outcome(case) for name, case in CASES.items()}
    found |= {name: refusal(case) for name, case in WRONG.items()}
    if not differentiates_inside():
        found |= dict.fromkeys(INSIDE, "plain JAX fails")
    print(json.dumps(found))
