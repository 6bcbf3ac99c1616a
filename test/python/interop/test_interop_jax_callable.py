"""JAX: Python functions that launch kernels, gradients of kernels, and what the wrappers refuse."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warp as wp

jax = pytest.importorskip("jax")
jnp = jax.numpy


@wp.kernel
def scale(x: wp.array(dtype=float), s: float, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = s * x[i]


@wp.kernel
def add(x: wp.array(dtype=float), total: wp.array(dtype=float)):
    i = wp.tid()
    total[i] = total[i] + x[i]


@wp.kernel
def wave(x: wp.array(dtype=wp.vec2), n: wp.array(dtype=int), s: float, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = wp.sin(s * x[i][0]) * x[i][1] ** 2.0 + float(n[i])


@wp.kernel
def half_square(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float16)):
    i = wp.tid()
    y[i] = x[i] * x[i]


def twice(x: wp.array(dtype=float), s: float, y: wp.array(dtype=float)):
    between = wp.empty_like(x)
    wp.launch(scale, x.shape, [x, s], [between])
    wp.launch(scale, x.shape, [between, s], [y])


def running(x: wp.array(dtype=float), total: wp.array(dtype=float), y: wp.array(dtype=float)):
    wp.launch(scale, x.shape, [x, 3.0], [y])
    wp.launch(add, x.shape, [x, total])


# Eagerly, compiled, and in the middle of other operations.
def test_functions_of_launches(place):
    function = wp.jax_callable(twice)
    x = jnp.arange(1000.0, dtype=jnp.float32)
    assert np.array_equal(function(x, 2.0)[0], 4.0 * np.arange(1000.0))
    around = jax.jit(lambda x: function(function(x + 1.0, 3.0)[0], 0.5)[0] * 2.0)
    for _ in range(3):
        assert np.array_equal(around(x), 4.5 * (np.arange(1000.0) + 1.0))


def test_arrays_that_are_input_and_output(place):
    function = wp.jax_callable(running, num_outputs=2, in_out_argnames=["total"])
    x, total = jnp.ones(8, jnp.float32), jnp.arange(8, dtype=jnp.float32)
    new, y = jax.jit(function)(x, total)
    assert np.array_equal(new, np.arange(8) + 1) and np.array_equal(y, np.full(8, 3.0))
    assert np.array_equal(total, np.arange(8))


def test_shapes_of_outputs(place):
    def spread(x: wp.array(dtype=wp.vec2), y: wp.array2d(dtype=float), n: wp.array(dtype=wp.vec2)):
        y.fill_(2.0)
        wp.copy(n, x)

    function = wp.jax_callable(spread, num_outputs=2)
    x = jnp.arange(6, dtype=jnp.float32).reshape(3, 2)
    y, n = function(x, output_dims={"y": (2, 5), "n": x.shape})
    assert y.shape == (2, 5) and np.array_equal(n, x) and (y == 2.0).all()
    with pytest.raises(ValueError, match="expects a shape for 'n'"):
        function(x, output_dims={"y": (2, 5)})


@pytest.mark.parametrize("method", ["sequential", "broadcast_all", "expand_dims"])
def test_batches(place, method):
    def plus(x: wp.array(dtype=float), start: wp.array(dtype=float), y: wp.array(dtype=float)):
        wp.copy(y, start)
        wp.launch(add, x.shape, [x, y])

    function = wp.jax_callable(plus, vmap_method=method)
    x = jnp.arange(12, dtype=jnp.float32).reshape(3, 4)
    (y,) = jax.vmap(function, in_axes=(0, None))(x, jnp.ones(4, jnp.float32))
    assert np.array_equal(y, 1.0 + x)
    twofold = jax.vmap(jax.vmap(function, in_axes=(0, None)), in_axes=(None, 0))
    (y,) = twofold(x, jnp.arange(8, dtype=jnp.float32).reshape(2, 4))
    assert np.array_equal(y, np.arange(8).reshape(2, 1, 4) + np.asarray(x))


def test_errors_of_functions_are_errors_of_jax(place):
    def fails(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        raise RuntimeError("there is no moon")

    with pytest.raises(Exception, match="there is no moon"):
        wp.jax_callable(fails)(jnp.ones(3, jnp.float32))[0].block_until_ready()


def test_functions_with_one_source_are_told_apart(place):
    def make(s):
        def function(x: wp.array(dtype=float), y: wp.array(dtype=float)):
            wp.launch(scale, x.shape, [x, s], [y])

        return function

    x = jnp.ones(4, jnp.float32)
    made = [make(float(s)) for s in range(5)]
    assert [float(wp.jax_callable(f)(x)[0][0]) for f in made] == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_one_object_for_the_same_arguments():
    assert wp.jax_callable(twice) is wp.jax_callable(twice, in_out_argnames=[])
    assert wp.jax_callable(twice) is not wp.jax_callable(twice, vmap_method="sequential")
    assert wp.jax_kernel(scale) is wp.jax_kernel(scale)
    assert wp.jax_kernel(scale) is not wp.jax_kernel(scale, enable_backward=True)


MODES = [wp.JaxCallableGraphMode(number) for number in range(5)]


@pytest.mark.parametrize("mode", MODES, ids=lambda mode: mode.name)
def test_graph_modes(device, place, mode):
    function = wp.jax_callable(twice, graph_mode=mode, graph_cache_max=2)
    x = jnp.arange(64.0, dtype=jnp.float32)
    if device == "cpu" and mode > wp.JaxCallableGraphMode.JAX:
        with pytest.raises(Exception, match="needs a CUDA device"):
            function(x, 3.0)[0].block_until_ready()
        return
    compiled = jax.jit(lambda x: function(x, 3.0)[0])
    for shift in range(6):
        assert np.array_equal(compiled(x + shift), 9.0 * (np.arange(64.0) + shift))
    assert len(function.graphs) <= 2
    wp.clear_jax_callable_graph_cache(function)
    assert not function.graphs
    assert np.array_equal(compiled(x), 9.0 * np.arange(64.0))


def test_kernels_are_compiled_for_all_devices_beforehand(place):
    mode = wp.JaxModulePreloadMode.ALL_DEVICES
    (y,) = wp.jax_callable(twice, module_preload_mode=mode)(jnp.ones(4, jnp.float32), 2.0)
    assert np.array_equal(y, [4.0] * 4)


# Gradients.


def expected_wave(x, n, s):
    return jnp.sin(s * x[:, 0]) * x[:, 1] ** 2 + n


def test_gradients_of_kernels(place):
    function = wp.jax_kernel(wave, enable_backward=True)
    rng = np.random.default_rng(0)
    x = jnp.asarray(rng.standard_normal((50, 2)), jnp.float32)
    n, weight = jnp.arange(50, dtype=jnp.int32), jnp.asarray(rng.standard_normal(50), jnp.float32)

    def loss(apply, x):
        return jnp.sum(weight * apply(x) ** 2)

    for transform in (lambda f: f, jax.jit):
        found = transform(jax.grad(lambda x: loss(lambda x: function(x, n, 1.5)[0], x)))(x)
        expected = jax.grad(lambda x: loss(lambda x: expected_wave(x, n, 1.5), x))(x)
        np.testing.assert_allclose(found, expected, rtol=2e-4, atol=2e-4)
    # The call itself is what it is without gradients.
    np.testing.assert_allclose(
        function(x, n, 1.5)[0], expected_wave(x, n, 1.5), rtol=1e-5, atol=1e-5
    )


def test_gradients_of_batches(place):
    function = wp.jax_kernel(wave, enable_backward=True)
    x = jnp.linspace(-1.0, 1.0, 24, dtype=jnp.float32).reshape(3, 4, 2)
    n = jnp.zeros(4, jnp.int32)
    found = jax.vmap(jax.grad(lambda x: function(x, n, 2.0)[0].sum()))(x)
    expected = jax.vmap(jax.grad(lambda x: expected_wave(x, n, 2.0).sum()))(x)
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)


def test_gradients_of_several_outputs(place):
    function = wp.jax_kernel(scale_both, num_outputs=2, enable_backward=True)
    x = jnp.asarray([1.0, 2.0, 4.0], jnp.float32)
    (dx,) = jax.vjp(lambda x: tuple(function(x)), x)[1](
        (jnp.ones(3, jnp.float32), jnp.asarray([0.0, 1.0, 0.0], jnp.float32))
    )
    np.testing.assert_allclose(dx, [2.0, 4.0 + 12.0, 8.0], rtol=1e-6)


@wp.kernel
def scale_both(x: wp.array(dtype=float), y: wp.array(dtype=float), z: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = x[i] * x[i]
    z[i] = x[i] * x[i] * x[i]


def test_gradients_of_16_bits(place):
    function = wp.jax_kernel(half_square, enable_backward=True)
    x = jnp.asarray([1.0, -2.5, 0.125], jnp.float16)
    found = jax.grad(lambda x: function(x)[0].astype(jnp.float32).sum())(x)
    assert found.dtype == jnp.float16 and np.array_equal(found, 2 * np.asarray(x))


@wp.kernel
def block_sums(y: wp.array(dtype=int)):
    i = wp.tid()
    total = wp.tile_sum(wp.tile(i))
    y[i] = total[0]


def test_kernels_with_tiles(place, config):
    config.enable_cpu_blocks = True
    for block_dim in (32, 64):
        expected = np.arange(128).reshape(-1, block_dim).sum(1).repeat(block_dim)
        function = wp.jax_kernel(block_sums, launch_dims=128, block_dim=block_dim)
        assert np.array_equal(jax.jit(function)()[0], expected)


@wp.kernel
def rows(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    i = wp.tid()
    for j in range(x.shape[1]):
        y[i, j] = x[i, j] * x[i, j]


def test_outputs_have_the_shape_of_inputs_where_a_thread_writes_several(place):
    x = jnp.arange(6, dtype=jnp.float32).reshape(2, 3)
    function = wp.jax_kernel(rows, launch_dims=2, enable_backward=True)
    assert np.array_equal(function(x)[0], x * x)
    assert np.array_equal(jax.grad(lambda x: function(x)[0].sum())(x), 2 * x)


def test_extents_beyond_31_bits():
    many = jax.ShapeDtypeStruct((2**31 + 1,), jnp.float32)
    with pytest.raises(ValueError, match=r"below 2\^31, but got \(2147483649,"):
        jax.jit(lambda x: wp.jax_kernel(add, in_out_argnames=["total"])(x, x)).lower(many)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: wp.jax_callable(scale), "expects a function"),
        (lambda: wp.jax_callable(lambda x, y: None)(jnp.ones(3)), "'x' has no annotation"),
        (lambda: wp.jax_callable(twice, num_outputs=0), "1 to 3 outputs"),
        (lambda: wp.jax_callable(twice, num_outputs=2)(jnp.ones(3)), "output 's'"),
        (lambda: wp.jax_callable(twice)(jnp.ones(3)), "expects 2 arguments, but got 1"),
        (lambda: wp.jax_callable(twice)(jnp.ones(3, jnp.int32), 1.0), "'float32'.*'int32'"),
        (lambda: wp.jax_callable(twice, in_out_argnames=["y", "y"]), "in-out arguments twice"),
        (lambda: wp.jax_callable(twice, in_out_argnames=["z"]), "in-out arguments of"),
        (
            lambda: wp.jax_callable(twice, 2, in_out_argnames=["y"]),
            "in-out arguments come before outputs",
        ),
        (lambda: wp.jax_callable(twice, stage_in_argnames=["q"]), r"no argument \['q'\]"),
        (lambda: wp.jax_kernel(add, in_out_argnames=["total"], enable_backward=True), "no inputs"),
        (lambda: wp.jax_callable(twice, graph_mode=9), "graph_mode.*9|9 is not a valid"),
    ],
)
def test_refusals(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


# Programs that JAX keeps on disk find their functions in the next process, and each device of a
# mesh gets its own part.
def test_processes_and_shards(tmp_path):
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import jax, numpy as np, warp as wp
from jax.sharding import Mesh, PartitionSpec
from test_interop_jax_callable import twice
jax.config.update("jax_compilation_cache_dir", {str(tmp_path)!r})
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
function = wp.jax_callable(twice)
mesh = Mesh(np.array(jax.devices("cpu")), ("x",))
each = jax.shard_map(lambda x: function(x, 3.0)[0], mesh=mesh, in_specs=PartitionSpec("x"),
                     out_specs=PartitionSpec("x"))
x = jax.numpy.arange(8, dtype="float32")
for _ in range(5):
    assert np.array_equal(jax.jit(each)(x), 9.0 * np.arange(8))
print("equal")
"""
    flags = "--xla_force_host_platform_device_count=2"
    environment = {**os.environ, "JAX_PLATFORMS": "cpu", "XLA_FLAGS": flags}
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=False,
            env=environment,
            timeout=300,
        )
        assert "equal" in done.stdout, done.stderr
        assert list(tmp_path.iterdir())


def test_extents_of_launches_that_are_too_many():
    for dims in ((2**31 + 1,), (1, 2**31 + 1)):
        function = wp.jax_kernel(scale, launch_dims=dims, output_dims=1)
        with pytest.raises(ValueError, match=r"below 2\^31, but got .*2147483649"):
            jax.jit(lambda x, call=function: call(x, 2.0)).lower(jnp.ones(1, dtype=jnp.float32))


def test_threads_of_a_block_as_given():
    assert wp.jax_kernel(scale).block_dim is None
    assert wp.jax_kernel(scale, block_dim=np.int64(64)).block_dim == 64
