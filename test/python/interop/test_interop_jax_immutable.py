"""JAX takes its arrays for immutable: nothing here writes one that is no output."""

import numpy as np
import pytest

import warp as wp

jax = pytest.importorskip("jax")
jnp = jax.numpy


@wp.kernel
def double(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = 2.0 * x[i]


@wp.kernel
def overwrite(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    x[i] = 7.0
    y[i] = x[i]


@wp.kernel
def count(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.atomic_add(x, 0, 1.0)
    y[wp.tid()] = x[0]


WRITERS = [overwrite, count]
FORMS = {
    "argument": lambda x: x,
    "from_jax": wp.from_jax,
    "numpy": np.asarray,
    "shared": lambda x: wp.array(x, copy=False, device="cpu"),
}


@pytest.mark.parametrize("form", FORMS)
def test_launches(form):
    x = jax.device_put(np.arange(4, dtype=np.float32), jax.devices("cpu")[0])
    y = wp.zeros(4, dtype=float, device="cpu")
    wp.launch(double, 4, [FORMS[form](x), y], device="cpu")
    np.testing.assert_array_equal(y.numpy(), [0, 2, 4, 6])
    for kernel in WRITERS:
        with pytest.raises(ValueError, match=f"{kernel.key}.*'x' is a read-only array"):
            wp.launch(kernel, 4, [FORMS[form](x), y], device="cpu")
    np.testing.assert_array_equal(x, [0, 1, 2, 3])


@pytest.mark.parametrize("kernel", WRITERS)
def test_kernels_of_jax(kernel):
    """A kernel that may write an input says so when it is traced, and how to declare it."""
    x = jnp.arange(4.0, dtype=jnp.float32)
    for call in (wp.jax_kernel(kernel), jax.jit(wp.jax_kernel(kernel))):
        with pytest.raises(ValueError, match="'x' is an input.*line.*in_out_argnames"):
            call(x)
    np.testing.assert_array_equal(x, [0, 1, 2, 3])
    declared = wp.jax_kernel(overwrite, num_outputs=2, in_out_argnames=["x"])
    changed, y = declared(jnp.array(x))
    np.testing.assert_array_equal(changed, [7, 7, 7, 7])
    np.testing.assert_array_equal(y, [7, 7, 7, 7])
    np.testing.assert_array_equal(x, [0, 1, 2, 3])


def test_functions_of_jax():
    """A function that launches such a kernel fails where it does that."""

    def advance(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        wp.launch(overwrite, x.shape[0], [x, y])

    def fill(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        x.zero_()

    x = jnp.arange(4.0, dtype=jnp.float32)
    for function in (advance, fill):
        with pytest.raises(Exception, match="read-only"):
            jax.block_until_ready(wp.jax_callable(function)(x))
    np.testing.assert_array_equal(x, [0, 1, 2, 3])
