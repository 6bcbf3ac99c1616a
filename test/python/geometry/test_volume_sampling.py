"""Volumes in kernels: samples, gradients, stores and transforms against NumPy in float64."""

import numpy as np
import pytest

import warp as wp

SHAPE, BACKGROUND = (20, 17, 9), -7.0


@pytest.fixture(scope="module")
def values():
    return np.random.default_rng(0).standard_normal(SHAPE).astype(np.float32)


def at(values, voxels):
    """Values of voxels, the background outside."""
    inside = ((voxels >= 0) & (voxels < values.shape[:3])).all(axis=1)
    found = np.full((len(voxels), *values.shape[3:]), BACKGROUND, dtype=np.float64)
    found[inside] = values[tuple(voxels[inside].T)]
    return found


def trilinear(values, p):
    p = p.astype(np.float64)
    cell = np.floor(p).astype(int)
    x = p - cell
    total = 0.0
    for corner in range(8):
        d = np.array([corner >> 2, corner >> 1 & 1, corner & 1])
        weight = np.prod(np.where(d, x, 1 - x), axis=1)
        total = total + (at(values, cell + d).T * weight).T
    return total


@wp.kernel
def sample(
    id: wp.uint64,
    p: wp.array(dtype=wp.vec3),
    linear: wp.array(dtype=float),
    near: wp.array(dtype=float),
    slope: wp.array(dtype=wp.vec3),
):
    i = wp.tid()
    linear[i] = wp.volume_sample_f(id, p[i], wp.Volume.LINEAR)
    near[i] = wp.volume_sample(id, p[i], wp.Volume.CLOSEST, dtype=float)
    along = wp.vec3()
    again = wp.volume_sample_grad_f(id, p[i], wp.Volume.LINEAR, along)
    slope[i] = along


def points(n=2000):
    return np.random.default_rng(1).uniform(-3, 22, (n, 3)).astype(np.float32)


def test_samples_and_both_gradients(device, values):
    volume = wp.Volume.load_from_numpy(values, bg_value=BACKGROUND, device=device)
    p = points()
    x = wp.array(p, dtype=wp.vec3, device=device, requires_grad=True)
    linear = wp.zeros(len(p), dtype=float, device=device, requires_grad=True)
    near = wp.zeros(len(p), dtype=float, device=device)
    slope = wp.zeros(len(p), dtype=wp.vec3, device=device)
    with wp.Tape() as tape:
        wp.launch(sample, dim=len(p), inputs=[volume.id, x, linear, near, slope], device=device)
    assert np.abs(linear.numpy() - trilinear(values, p)).max() < 4e-6
    away = (np.sign(p) * np.floor(np.abs(p) + 0.5)).astype(int)
    assert (near.numpy() == at(values, away)).all()
    step = 2.0**-12
    inner = (np.abs(p - np.round(p)) > 2 * step).all(axis=1)
    wide = p.astype(np.float64)
    for axis in range(3):
        h = step * np.eye(3)[axis]
        difference = (trilinear(values, wide + h) - trilinear(values, wide - h)) / (2 * step)
        assert np.abs(slope.numpy()[inner, axis] - difference[inner]).max() < 1e-5
    tape.backward(grads={linear: wp.ones_like(linear)})
    assert np.abs(x.grad.numpy() - slope.numpy()).max() < 1e-5


def test_vectors_doubles_and_jacobians(device):
    rng = np.random.default_rng(2)
    values = rng.standard_normal((9, 9, 9, 3))

    @wp.kernel
    def sample_vector(
        id: wp.uint64,
        p: wp.array(dtype=wp.vec3),
        out: wp.array(dtype=wp.vec3d),
        jacobian: wp.array(dtype=wp.mat33d),
    ):
        i = wp.tid()
        j = wp.mat33d()
        out[i] = wp.volume_sample_grad(id, p[i], wp.Volume.LINEAR, j, dtype=wp.vec3d)
        jacobian[i] = j

    background = wp.vec3d(BACKGROUND, BACKGROUND, BACKGROUND)
    volume = wp.Volume.load_from_numpy(values, bg_value=background, device=device)
    p = rng.uniform(0, 8, (200, 3)).astype(np.float32)
    out = wp.zeros(200, dtype=wp.vec3d, device=device)
    jacobian = wp.zeros(200, dtype=wp.mat33d, device=device)
    x = wp.array(p, dtype=wp.vec3, device=device)
    wp.launch(sample_vector, dim=200, inputs=[volume.id, x, out, jacobian], device=device)
    assert np.abs(out.numpy() - trilinear(values, p)).max() < 1e-6
    h = 1e-4 * np.array([0.0, 1.0, 0.0])
    inner = np.abs(p[:, 1] - np.round(p[:, 1])) > 1e-3
    wide = p.astype(np.float64)
    difference = (trilinear(values, wide + h) - trilinear(values, wide - h)) / 2e-4
    assert np.abs(jacobian.numpy()[inner][:, :, 1] - difference[inner]).max() < 1e-5


def test_stores_reach_leaves_alone(device):
    @wp.kernel
    def store(id: wp.uint64, out: wp.array(dtype=int)):
        wp.volume_store_i(id, 1, 2, 3, 42)
        wp.volume_store(id, 100, 0, 0, 43)
        out[0] = wp.volume_lookup_i(id, 1, 2, 3)
        out[1] = wp.volume_lookup(id, 100, 0, 0, dtype=int)
        out[2] = wp.volume_sample_i(id, wp.vec3(0.5, 1.5, 2.5))
        # A grid of other values has none of these.
        out[3] = int(wp.volume_lookup_f(id, 1, 2, 3))

    volume = wp.Volume.allocate([0, 0, 0], [7, 7, 7], 1.0, bg_value=5, device=device)
    out = wp.zeros(4, dtype=int, device=device)
    wp.launch(store, dim=1, inputs=[volume.id, out], device=device)
    assert out.numpy().tolist() == [42, 5, 42, 0]


def test_threads_find_what_they_store(device):
    """A thread's loads after its stores have new values; no store changes tiles or other types."""

    @wp.kernel
    def twice(id: wp.uint64, out: wp.array3d(dtype=float)):
        i, j, k = wp.tid()
        wp.volume_store_f(id, i, j, k, 2.0 * wp.volume_lookup_f(id, i, j, k))
        doubled = wp.volume_lookup_f(id, i, j, k)
        wp.volume_store_f(id, i, j, k, doubled + 1.0)
        wp.volume_store_f(id, i + 1000, j, k, 3.0)
        wp.volume_store_i(id, i, j, k, 3)
        out[i, j, k] = 1000.0 * doubled + wp.volume_lookup_f(id, i, j, k)

    @wp.kernel
    def move(id: wp.uint64, out: wp.array3d(dtype=wp.vec3)):
        i, j, k = wp.tid()
        at = wp.vec3(float(i), float(j), float(k))
        wp.volume_store_v(id, i, j, k, 2.0 * wp.volume_lookup_v(id, i, j, k) + at)
        out[i, j, k] = wp.volume_lookup_v(id, i, j, k)

    random = np.random.default_rng(7)
    shape = (19, 20, 33)
    x = random.integers(0, 50, shape).astype(np.float32)
    volume = wp.Volume.load_from_numpy(x, bg_value=BACKGROUND, device=device)
    out = wp.zeros(shape, dtype=float, device=device)
    wp.launch(twice, shape, [volume.id, out], device=device)
    np.testing.assert_array_equal(out.numpy(), 1000.0 * (2.0 * x) + (2.0 * x + 1.0))
    x = random.integers(0, 50, (*shape, 3)).astype(np.float32)
    volume = wp.Volume.load_from_numpy(x, bg_value=(0.0, 0.0, 0.0), device=device)
    out = wp.zeros(shape, dtype=wp.vec3, device=device)
    wp.launch(move, shape, [volume.id, out], device=device)
    places = np.stack(np.indices(shape), axis=-1)
    np.testing.assert_array_equal(out.numpy(), 2.0 * x + places)


def test_transforms_are_inverse_and_linear(device):
    @wp.kernel
    def there(id: wp.uint64, p: wp.array(dtype=wp.vec3), out: wp.array2d(dtype=wp.vec3)):
        i = wp.tid()
        out[0, i] = wp.volume_index_to_world(id, p[i])
        out[1, i] = wp.volume_world_to_index(id, out[0, i])
        out[2, i] = wp.volume_index_to_world_dir(id, p[i])
        out[3, i] = wp.volume_transform(id, p[i])

    matrix = np.array([[0.5, 0.1, 0.0], [0.0, 0.25, 0.2], [-0.3, 0.0, 2.0]], dtype=np.float32)
    tiles = wp.array([[0, 0, 0]], dtype=wp.vec3i, device=device)
    volume = wp.Volume.allocate_by_tiles(
        tiles, transform=matrix, translation=(1.0, 2.0, 3.0), device=device
    )
    p = points(50)
    out = wp.zeros((4, 50), dtype=wp.vec3, device=device)
    x = wp.array(p, dtype=wp.vec3, device=device)
    wp.launch(there, dim=50, inputs=[volume.id, x, out], device=device)
    world, back, turned, first_form = out.numpy()
    assert np.abs(world - (p @ matrix.T + [1, 2, 3])).max() < 1e-5
    assert np.abs(back - p).max() < 2e-5
    assert np.abs(turned - p @ matrix.T).max() < 1e-5
    assert (first_form == world).all()


def test_tables_of_leaves_change_no_sample(device):
    """A leaf far away leaves a volume without a table; cells meet leaves, gaps and the outside."""
    random = np.random.default_rng(5)
    tiles = np.array([[0, 0, 0], [8, 0, 0], [8, 8, 0], [0, 0, 16], [-8, -8, -8], [16, 8, 8]])
    far = np.concatenate([tiles, [[8000, 0, 0]]])

    @wp.kernel
    def fill(id: wp.uint64, v: wp.array(dtype=wp.vec3i), x: wp.array(dtype=wp.vec3)):
        i = wp.tid()
        wp.volume_store_v(id, v[i][0], v[i][1], v[i][2], x[i])

    @wp.kernel
    def look(
        id: wp.uint64,
        p: wp.array(dtype=wp.vec3),
        a: wp.array(dtype=wp.vec3),
        b: wp.array(dtype=wp.vec3),
    ):
        i = wp.tid()
        a[i] = wp.volume_sample_v(id, p[i], wp.Volume.LINEAR)
        b[i] = wp.volume_lookup_v(id, int(p[i][0]), int(p[i][1]), int(p[i][2]))

    offsets = np.stack(np.unravel_index(np.arange(512), (8, 8, 8)), -1)
    voxels = (tiles[:, None] + offsets).reshape(-1, 3)
    values = random.standard_normal((len(voxels), 3)).astype(np.float32)
    p = np.concatenate(
        [
            random.uniform(-12, 28, (3000, 3)),
            [[np.nan, 1, 2], [np.inf, 0, 0], [-1e30, 3, 3], [2**31] * 3],
        ]
    )
    x = wp.array(p.astype(np.float32), dtype=wp.vec3, device=device)
    found = []
    for places in (tiles, far):
        made = wp.array(places, dtype=wp.vec3i, device=device)
        background = wp.vec3(BACKGROUND, BACKGROUND, BACKGROUND)
        volume = wp.Volume.allocate_by_tiles(made, 1.0, background, device=device)
        at_voxels = [
            wp.array(voxels, dtype=wp.vec3i, device=device),
            wp.array(values, dtype=wp.vec3, device=device),
        ]
        wp.launch(fill, dim=len(voxels), inputs=[volume.id, *at_voxels], device=device)
        out = [wp.zeros(len(p), dtype=wp.vec3, device=device) for _ in range(2)]
        wp.launch(look, dim=len(p), inputs=[volume.id, x, *out], device=device)
        found.append([one.numpy() for one in out])
    dense = np.full((48, 48, 48, 3), BACKGROUND)
    dense[tuple((voxels + 16).T)] = values
    inside = p[:3000].astype(np.float32)
    assert (
        np.abs(found[0][0][:3000] - trilinear(dense, inside.astype(np.float64) + 16)).max() < 1e-5
    )
    assert (found[0][1][:3000] == dense[tuple(inside.astype(int).T + 16)].astype(np.float32)).all()
    for with_table, without in zip(*found):
        np.testing.assert_array_equal(with_table, without)


def test_a_wrong_gradient_is_told_with_public_names():
    @wp.kernel
    def transposed(volume: wp.uint64, out: wp.array(dtype=wp.vec4)):
        grad = wp.matrix(shape=(3, 4), dtype=float)
        out[0] = wp.volume_sample_grad(volume, wp.vec3(), wp.Volume.LINEAR, grad, dtype=wp.vec4)

    with pytest.raises(TypeError, match="no overload of 'volume_sample_grad'") as caught:
        wp.launch(transposed, 1, [wp.uint64(0), wp.zeros(1, dtype=wp.vec4)], device="cpu")
    declared = "volume_sample_grad(id: uint64, uvw: vec3f, sampling_mode: int32, grad: matrix("
    assert declared in str(caught.value) and "dtype: type[vec4f])" in str(caught.value)
    assert "_sample_grad" not in str(caught.value).replace("volume_sample_grad", "")


@pytest.mark.parametrize("lanes", [1, 4, 16])
@pytest.mark.parametrize("dtype", [wp.float32, wp.int32, wp.vec3, wp.float64, wp.vec3d])
def test_lanes_store_voxels(dtype, lanes, device):
    """Threads read back what they stored; voxels outside of leaves and other grids stay."""

    @wp.kernel(module="unique", module_options={"cpu_lanes": lanes})
    def doubled(
        id: wp.uint64,
        v: wp.array(dtype=wp.vec3i),
        x: wp.array(dtype=dtype),
        back: wp.array(dtype=dtype),
    ):
        i = wp.tid()
        if i % 3 != 1:
            wp.volume_store(id, v[i][0], v[i][1], v[i][2], x[i])
            wp.volume_store(id, v[i][0], v[i][1], v[i][2], wp.int64(7))
            y = wp.volume_lookup(id, v[i][0], v[i][1], v[i][2], dtype=dtype)
            wp.volume_store(id, v[i][0], v[i][1], v[i][2], y + y)
            back[i] = wp.volume_lookup(id, v[i][0], v[i][1], v[i][2], dtype=dtype)

    rng = np.random.default_rng(17)
    length = getattr(dtype, "_length_", 1)
    shape = (16, 8, 24) + ((length,) if length > 1 else ())
    real = wp.dtype_to_numpy(getattr(dtype, "_wp_scalar_type_", dtype))
    values = rng.integers(1, 90, shape).astype(real)
    background = dtype(*[5] * length)
    volume = wp.Volume.load_from_numpy(values, bg_value=background, device=device)
    inside = np.stack(np.unravel_index(rng.permutation(16 * 8 * 24)[:700], shape[:3]), -1)
    outside = np.array([[-1, 0, 0], [16, 0, 0], [3, 8, 3], [100000, 2, 2], [0, 0, -4000]])
    voxels = np.concatenate([inside[:301], outside, inside[301:]])
    x = rng.integers(100, 200, (len(voxels),) + shape[3:]).astype(real)
    back = wp.zeros(len(voxels), dtype=dtype, device=device)
    arrays = [wp.array(voxels, dtype=wp.vec3i, device=device), wp.array(x, dtype=dtype)]
    arrays[1] = arrays[1].to(device)
    wp.launch(doubled, len(voxels), [volume.id, *arrays, back], device=device)
    takes = np.arange(len(voxels)) % 3 != 1
    isin = (voxels >= 0).all(1) & (voxels < [16, 8, 24]).all(1)
    wanted = np.zeros_like(x)
    wanted[takes] = np.where(isin.reshape((-1,) + (1,) * (x.ndim - 1)), 2 * x, 5)[takes]
    np.testing.assert_array_equal(back.numpy(), wanted)
    stored = values.copy()
    stored[tuple(voxels[takes & isin].T)] = 2 * x[takes & isin]

    @wp.kernel(module="unique")
    def read(id: wp.uint64, out: wp.array3d(dtype=dtype)):
        i, j, k = wp.tid()
        out[i, j, k] = wp.volume_lookup(id, i, j, k, dtype=dtype)

    out = wp.zeros(shape[:3], dtype=dtype, device=device)
    wp.launch(read, shape[:3], [volume.id, out], device=device)
    np.testing.assert_array_equal(out.numpy(), stored)
