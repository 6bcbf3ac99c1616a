"""JAX: arrays over the same memory, and kernels inside `jit` and `vmap`."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warp as wp

jax = pytest.importorskip("jax")
jnp = jax.numpy

jax.config.update("jax_enable_x64", True)


@wp.kernel
def scale(x: wp.array(dtype=float), s: float, y: wp.array(dtype=float)):
    i = wp.tid()
    y[i] = s * x[i]


@wp.kernel
def neighbours(x: wp.array(dtype=wp.int32), y: wp.array(dtype=wp.int32)):
    i = wp.tid()
    n = x.shape[0]
    y[i] = x[(i + 1) % n] - x[i]


@wp.kernel
def sine_cosine(
    angle: wp.array(dtype=float), sines: wp.array(dtype=float), both: wp.array(dtype=wp.vec2)
):
    i = wp.tid()
    sines[i] = wp.sin(angle[i])
    both[i] = wp.vec2(wp.sin(angle[i]), wp.cos(angle[i]))


@wp.kernel
def accumulate(total: wp.array(dtype=wp.vec3), x: wp.array(dtype=wp.vec3), m: wp.mat33):
    i = wp.tid()
    total[i] = total[i] + m * x[i]


@wp.kernel
def outer(a: wp.array(dtype=float), b: wp.array(dtype=float), c: wp.array2d(dtype=float)):
    i, j = wp.tid()
    c[i, j] = a[i] * b[j]


def test_import_leaves_jax_alone():
    code = "import sys, warp; warp.zeros(3); sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_dtypes_and_devices(device, place):
    for scalar in (wp.bool, *wp.types.SCALAR_TYPES):
        assert wp.dtype_from_jax(wp.dtype_to_jax(scalar)) is scalar
        assert wp.dtype_from_jax(jnp.dtype(wp.dtype_to_jax(scalar))) is scalar
    assert wp.device_from_jax(place) is wp.get_device(device)
    with pytest.raises(TypeError, match="no scalar type"):
        wp.dtype_from_jax(jnp.complex64)


@pytest.mark.parametrize("scalar", [wp.bool, *wp.types.SCALAR_TYPES], ids=lambda t: t.__name__)
def test_arrays_share_memory(device, place, scalar):
    x = jnp.ones((4, 3), dtype=wp.dtype_to_jax(scalar))
    a = wp.from_jax(x)
    assert (a.shape, a.dtype, str(a.device)) == ((4, 3), scalar, device)
    assert a.ptr == x.unsafe_buffer_pointer()
    back = wp.to_jax(a)
    assert back.dtype == x.dtype and (back == x).all()
    assert back.unsafe_buffer_pointer() == a.ptr
    fresh = wp.ones(64, dtype=scalar, device=device)
    assert wp.to_jax(fresh).unsafe_buffer_pointer() == fresh.ptr


def test_composites_and_immutability(device, place):
    x = jnp.arange(12.0, dtype=jnp.float32).reshape(4, 3)
    a = wp.from_jax(x, dtype=wp.vec3)
    assert (a.shape, a.dtype) == ((4,), wp.vec3)
    with pytest.raises(ValueError, match="read-only"):
        a.zero_()
    assert np.array_equal(wp.to_jax(a), x)
    assert np.array_equal(wp.to_jax(wp.clone(a)), x)


@pytest.mark.parametrize("export", [wp.to_jax, jax.dlpack.from_dlpack], ids=["to_jax", "dlpack"])
@pytest.mark.parametrize("dtype", [jnp.float32, jnp.bfloat16, jnp.int64, jnp.bool_])
def test_round_trip_of_parts(device, place, export, dtype):
    """Arrays from JAX go back to it, read-only or not, whole or in part."""
    x = jnp.arange(24).reshape(4, 6).astype(dtype)
    for array in (wp.from_jax(x), wp.clone(wp.from_jax(x))):
        for part, expected in (
            (array[1:3], x[1:3]),
            (array[2], x[2]),
            (array.reshape((2, 12)), x.reshape(2, 12)),
            (array[2:2], x[2:2]),
        ):
            back = export(part)
            assert back.dtype == x.dtype and np.array_equal(back, expected)


def test_other_strides_are_copied(device, place):
    x = jnp.arange(24.0, dtype=jnp.float32).reshape(4, 6)
    for array in (wp.from_jax(x), wp.clone(wp.from_jax(x))):
        assert np.array_equal(wp.to_jax(array[:, 2]), x[:, 2])
        assert np.array_equal(wp.to_jax(array.transpose()), x.T)
        assert np.array_equal(wp.to_jax(array[::2, 1::3]), x[::2, 1::3])
    mats = wp.from_jax(x.reshape(6, 2, 2), dtype=wp.mat22)
    assert np.array_equal(wp.to_jax(mats[::2]), x.reshape(6, 2, 2)[::2])


@pytest.mark.parametrize(
    "make, message",
    [
        (
            lambda: jax.jit(lambda x: wp.from_jax(x).ptr)(jnp.ones(3)),
            "while JAX traces.*jax_kernel",
        ),
        (lambda: wp.from_jax([1.0]), "expects .*'list'"),
        (lambda: wp.from_jax(jax.random.key(0)), "expects .*Array"),
        (lambda: deleted(jnp.ones(3) + 1.0), "deleted or donated"),
        (lambda: wp.from_jax(jnp.zeros(3, jnp.complex64)), "no scalar type"),
        (lambda: wp.to_jax(None), "expects .*None"),
    ],
)
def test_refusals_of_exchanges(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def deleted(x):
    x.delete()
    return wp.from_jax(x)


def test_only_jax_gets_read_only_memory_without_being_told(device, place):
    """Consumers of before DLPack 1.0 would write to what they cannot know to be read-only."""
    a = wp.from_jax(jnp.ones(4, jnp.float32))
    for export in (lambda: a.__dlpack__(), lambda: wp.to_dlpack(a)):
        with pytest.raises(BufferError, match=r"read-only.*`wp\.clone"):
            export()
    assert wp.from_dlpack(a).read_only


# Eager, compiled, and in the middle of other operations.
def test_kernel(place):
    double = wp.jax_kernel(scale)
    x = jnp.arange(1000.0, dtype=jnp.float32)
    (y,) = double(x, 2.0)
    assert np.array_equal(y, 2.0 * np.arange(1000.0))

    @jax.jit
    def around(x):
        return double(double(x + 1.0, 3.0)[0], -1.0)[0] * 2.0

    for _ in range(3):
        assert np.array_equal(around(x), -6.0 * (np.arange(1000.0) + 1.0))
    # Other shapes trace again.
    assert np.array_equal(around(jnp.ones(3, jnp.float32)), np.full(3, -12.0))


def test_scalars_are_part_of_the_program(place):
    double = wp.jax_kernel(scale)
    x = jnp.ones(4, jnp.float32)
    compiled = jax.jit(lambda x, s: double(x, s)[0], static_argnums=1)
    assert [float(compiled(x, s)[0]) for s in (2.0, 5.0, 2.0)] == [2.0, 5.0, 2.0]
    with pytest.raises(TypeError, match="'s' must be known while tracing"):
        jax.jit(lambda x, s: double(x, s)[0])(x, 2.0)


def test_several_outputs_and_composites(place):
    function = jax.jit(wp.jax_kernel(sine_cosine, num_outputs=2))
    angle = jnp.linspace(0.0, 6.0, 50, dtype=jnp.float32)
    sines, both = function(angle)
    assert sines.shape == (50,) and both.shape == (50, 2)
    expected = np.stack([np.sin(angle), np.cos(angle)], 1)
    np.testing.assert_allclose(both, expected, atol=1e-6)
    np.testing.assert_array_equal(sines, both[:, 0])


def test_in_out(place):
    function = wp.jax_kernel(accumulate, num_outputs=1, in_out_argnames=["total"])
    # An in-out array is an input and an output; here no pure output follows.
    total = jnp.ones((5, 3), jnp.float32)
    x = jnp.arange(15.0, dtype=jnp.float32).reshape(5, 3)
    m = wp.mat33(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0)

    @jax.jit
    def twice(total, x):
        (total,) = function(total, x, m)
        return function(total, x, m)[0]

    expected = 1.0 + 2.0 * np.asarray(x) @ np.asarray(m).reshape(3, 3).T
    np.testing.assert_array_equal(twice(total, x), expected)
    # The argument itself is unchanged.
    assert (total == 1.0).all()


def test_launch_and_output_dims(place):
    a, b = jnp.arange(3.0, dtype=jnp.float32), jnp.arange(4.0, dtype=jnp.float32)
    expected = np.outer(a, b)
    fixed = wp.jax_kernel(outer, launch_dims=(3, 4))
    assert np.array_equal(jax.jit(fixed)(a, b)[0], expected)
    free = wp.jax_kernel(outer)
    assert np.array_equal(free(a, b, launch_dims=(3, 4))[0], expected)
    wider = free(a, b, launch_dims=(3, 4), output_dims={"c": (5, 4)})[0]
    assert wider.shape == (5, 4)
    assert np.array_equal(wider[:3], expected)
    with pytest.raises(ValueError, match="output 'c' expects 2 dimensions"):
        free(a, b)
    with pytest.raises(ValueError, match="a shape for 'c'"):
        free(a, b, launch_dims=(3, 4), output_dims={})


# A batch entry does not see its neighbours.
@pytest.mark.parametrize("method", ["broadcast_all", "expand_dims", "sequential"])
def test_vmap(place, method):
    function = wp.jax_kernel(neighbours, vmap_method=method)
    x = jnp.asarray(np.random.default_rng(1).integers(0, 100, (3, 4, 7)), jnp.int32)
    got = jax.jit(jax.vmap(jax.vmap(lambda row: function(row)[0])))(x)
    assert np.array_equal(got, np.roll(x, -1, axis=-1) - x)


@pytest.mark.parametrize("method", ["broadcast_all", "expand_dims"])
def test_vmap_over_some_arguments(place, method):
    function = wp.jax_kernel(outer, launch_dims=(3, 4), vmap_method=method)
    a = jnp.arange(6.0, dtype=jnp.float32).reshape(2, 3)
    b = jnp.arange(20.0, dtype=jnp.float32).reshape(5, 4)
    inner = jax.vmap(lambda a, b: function(a, b)[0], in_axes=(None, 0))
    got = jax.vmap(inner, in_axes=(0, None))(a, b)
    assert np.array_equal(got, np.einsum("ai,bj->abij", a, b))


def test_loop_of_jax(place):
    function = wp.jax_kernel(neighbours)
    x = jnp.asarray(np.random.default_rng(2).integers(0, 9, (3, 8)), jnp.int32)

    @jax.jit
    @jax.vmap
    def many(row):
        return jax.lax.fori_loop(0, 6, lambda _, state: function(state)[0], row)

    expected = np.asarray(x)
    for _ in range(6):
        expected = np.roll(expected, -1, axis=1) - expected
    assert np.array_equal(many(x), expected)


def test_empty_launch(place):
    (y,) = wp.jax_kernel(scale)(jnp.zeros(0, jnp.float32), 1.0)
    assert y.shape == (0,)


def test_inputs_that_are_no_jax_arrays(place):
    (y,) = wp.jax_kernel(scale)(np.ones(3, np.float32), np.float32(4.0))
    assert np.array_equal(y, [4.0] * 3)


def test_precision_must_be_enabled(place):
    @wp.kernel
    def halve(x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64)):
        i = wp.tid()
        y[i] = x[i] * wp.float64(0.5)

    assert wp.jax_kernel(halve)(jnp.ones(2))[0].dtype == jnp.float64
    narrow = jax.enable_x64 if hasattr(jax, "enable_x64") else jax.experimental.enable_x64
    with narrow(False), pytest.raises(TypeError, match="float64"):
        wp.jax_kernel(halve)(jnp.ones(2))


# A report of a kernel in debug mode becomes an error of JAX.
def test_failed_check(device, place, config):
    if device != "cpu":
        pytest.skip("CUDA reports when the device is synchronized")
    config.mode = "debug"

    @wp.kernel
    def beyond(x: wp.array(dtype=float), y: wp.array(dtype=float)):
        i = wp.tid()
        y[i] = x[i + 1]

    with pytest.raises(Exception, match="beyond"):
        wp.jax_kernel(beyond)(jnp.ones(4, jnp.float32))[0].block_until_ready()


def test_calls_of_one_kernel_are_told_apart(place):
    x = jnp.ones(4, jnp.float32)
    results = [wp.jax_kernel(scale)(x, float(s))[0] for s in range(20)]
    assert [float(y[0]) for y in results] == list(range(20))


@wp.struct
class WithArray:
    a: wp.array(dtype=float)


@wp.kernel
def takes_struct(s: WithArray, y: wp.array(dtype=float)):
    y[wp.tid()] = s.a[0]


@wp.kernel
def generic(x: wp.array(dtype=wp.Float), y: wp.array(dtype=wp.Float)):
    y[wp.tid()] = x[wp.tid()]


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: wp.jax_kernel(lambda x: x), "expects a kernel"),
        (lambda: wp.jax_kernel(generic), "generic parameters"),
        (lambda: wp.jax_kernel(scale, num_outputs=0), "1 to 3 outputs"),
        (lambda: wp.jax_kernel(scale, block_dim=True), "block_dim must be an integer"),
        (lambda: wp.jax_kernel(scale, block_dim=1.5), "block_dim must be an integer"),
        (lambda: wp.jax_kernel(scale, block_dim=0), "block_dim must be positive"),
        (lambda: wp.jax_kernel(scale, in_out_argnames=["z"]), "in-out arguments"),
        (lambda: wp.jax_kernel(scale, in_out_argnames=["x", "y"]), "count the 2"),
        (lambda: wp.jax_kernel(scale, num_outputs=2)(jnp.ones(3)), "output 's'"),
        (lambda: wp.jax_kernel(scale)(jnp.ones(3)), "expects 2 arguments, but got 1"),
        (lambda: wp.jax_kernel(scale)(jnp.ones(3, jnp.int32), 1.0), "'float32'.*'int32'"),
        (lambda: wp.jax_kernel(scale)(jnp.ones((3, 2)), 1.0), "expects 1 dimensions"),
        (lambda: wp.jax_kernel(takes_struct)(WithArray()), "structs with arrays"),
    ],
)
def test_refusals(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


# Programs that JAX keeps on disk find their kernels in the next process.
def test_compilation_cache(tmp_path):
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import jax, warp as wp
jax.config.update("jax_compilation_cache_dir", {str(tmp_path)!r})
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
from test_interop_jax import scale
triple = wp.jax_kernel(scale)
print(jax.jit(lambda x: triple(x, 3.0)[0])(jax.numpy.ones(2, "float32")))
"""
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, check=False
        )
        assert "[3. 3.]" in done.stdout, done.stderr
        assert list(tmp_path.iterdir())


# Each device of a mesh gets its own part.
def test_shards():
    code = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import jax, numpy as np, warp as wp
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from test_interop_jax import neighbours
mesh = Mesh(np.array(jax.devices("cpu")), ("x",))
where = NamedSharding(mesh, PartitionSpec("x"))
x = jax.device_put(jax.numpy.arange(40, dtype="int32") ** 2, where)
run = wp.jax_kernel(neighbours)
each = jax.shard_map(lambda x: run(x)[0], mesh=mesh, in_specs=PartitionSpec("x"),
                 out_specs=PartitionSpec("x"), check_vma=False)
parts = np.asarray(x).reshape(4, 10)
expected = (np.roll(parts, -1, axis=1) - parts).reshape(-1)
for _ in range(20):
    assert np.array_equal(jax.jit(each)(x), expected)
print("equal")
"""
    environment = {
        **os.environ,
        "JAX_PLATFORMS": "cpu",
        "XLA_FLAGS": "--xla_force_host_platform_device_count=4",
    }
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=120,
    )
    assert "equal" in done.stdout, done.stderr
