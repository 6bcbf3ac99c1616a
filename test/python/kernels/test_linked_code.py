"""First launches of searches, solves and tile products on a GPU run linked machine code.

Later launches run tier-1 code, with the same bits.
"""

import numpy as np
import pytest

import warp as wp
from kernel_cache import codes
from spheres import sphere
from warp import _native


@pytest.fixture
def gpu(device):
    if not wp.get_device(device).is_cuda:
        pytest.skip("of GPUs")
    return device


def ball(device):
    """A mesh around the origin."""
    points, faces = sphere(40)
    return wp.Mesh(
        wp.array(points, dtype=wp.vec3, device=device),
        wp.array(faces.ravel(), dtype=int, device=device),
    )


def make_search():
    @wp.kernel(module="unique")
    def search(
        mesh: wp.uint64,
        bvh: wp.uint64,
        x: wp.array(dtype=wp.vec3),
        near: wp.array(dtype=wp.vec3),
        hits: wp.array(dtype=float),
        counts: wp.array(dtype=int),
    ):
        i = wp.tid()
        p = x[i]
        point = wp.mesh_query_point(mesh, p, 10.0)
        if point.result:
            near[i] = wp.mesh_eval_position(mesh, point.face, point.u, point.v)
        ray = wp.mesh_query_ray(mesh, p, wp.normalize(wp.vec3(0.3, 0.2, 1.0)), 10.0)
        if ray.result:
            hits[i] = ray.t
        q = wp.bvh_query_aabb(bvh, p - wp.vec3(0.2), p + wp.vec3(0.2))
        item = int(0)
        while wp.bvh_query_next(q, item):
            counts[i] += 1

    return search


def make_factor(n=20):
    @wp.kernel(module="unique")
    def factor(a: wp.array3d(dtype=float), b: wp.array2d(dtype=float), x: wp.array2d(dtype=float)):
        i = wp.tid()
        lower = wp.tile_cholesky(wp.tile_load(a[i], shape=(n, n)))
        wp.tile_store(x[i], wp.tile_cholesky_solve(lower, wp.tile_load(b[i], shape=n)))

    return factor


def make_transform(n=256):
    @wp.kernel(module="unique")
    def transform(x: wp.array2d(dtype=wp.vec2), y: wp.array2d(dtype=wp.vec2)):
        i = wp.tid()
        t = wp.tile_load(x, shape=(1, n), offset=(i, 0))
        wp.tile_fft(t)
        wp.tile_store(y, t, offset=(i, 0))

    return transform


class Searches:
    """Points and boxes against a ball."""

    def __init__(self, device, count=3000):
        self.kernel, self.device, self.count = make_search(), device, count
        self.mesh = ball(device)
        x = np.random.default_rng(3).normal(size=(count, 3)).astype(np.float32)
        self.x = wp.array(x, dtype=wp.vec3, device=device)
        low = wp.array(x - 0.1, dtype=wp.vec3, device=device)
        high = wp.array(x + 0.1, dtype=wp.vec3, device=device)
        self.bvh = wp.Bvh(low, high)
        self.expected = (np.abs(x[:, None] - x[None]) <= 0.3 + 1e-6).all(2).sum(1)
        self.prepare()

    def prepare(self):
        self.near = wp.zeros(self.count, dtype=wp.vec3, device=self.device)
        self.hits = wp.zeros(self.count, dtype=float, device=self.device)
        self.counts = wp.zeros(self.count, dtype=int, device=self.device)

    def launch(self):
        inputs = [self.mesh.id, self.bvh.id, self.x]
        wp.launch(self.kernel, self.count, inputs, self.outputs(), device=self.device)

    def outputs(self):
        return [self.near, self.hits, self.counts]

    def result(self):
        return [one.numpy() for one in self.outputs()]

    def check(self, found):
        near, _, counts = found
        assert np.abs(np.linalg.norm(near, axis=1) - 1).max() < 4e-3
        assert np.abs(counts - self.expected).max() <= 1


def make_product(dtype, tile, steps):
    """Sums that a loop adds up, stored and added once more, and a product of one step."""
    m, n, depth = tile
    Sum = wp.float64 if dtype is wp.float64 else wp.float32

    @wp.kernel(module="unique")
    def product(
        a: wp.array2d(dtype=dtype),
        b: wp.array2d(dtype=dtype),
        one: wp.array2d(dtype=dtype),
        total: wp.array2d(dtype=Sum),
    ):
        i, j = wp.tid()
        sums = wp.tile_zeros(shape=(m, n), dtype=Sum)
        for step in range(steps):
            x = wp.tile_load(a, shape=(m, depth), offset=(i * m, step * depth))
            y = wp.tile_load(b, shape=(depth, n), offset=(step * depth, j * n))
            wp.tile_matmul(x, y, sums)
        wp.tile_store(total, sums, offset=(i * m, j * n))
        wp.tile_atomic_add(total, sums, offset=(i * m, j * n))
        first = wp.tile_load(a, shape=(m, depth), offset=(i * m, 0))
        second = wp.tile_load(b, shape=(depth, n), offset=(0, j * n))
        wp.tile_store(
            one, wp.tile_map(wp.neg, wp.tile_matmul(first, second)), offset=(i * m, j * n)
        )

    return product


class Tiles:
    """Blocks that work on arrays."""

    def __init__(self, device, kernel, arrays, shape, dtype, check, dims=None, block=64):
        self.kernel, self.device, self.check_one = kernel, device, check
        self.arrays = [wp.array(a, dtype=dtype, device=device) for a in arrays]
        self.shape, self.dtype = shape, dtype
        self.dims, self.block = dims or shape[:1], block
        self.prepare()

    def prepare(self):
        self.out = wp.zeros(self.shape, dtype=self.dtype, device=self.device)

    def launch(self):
        wp.launch_tiled(
            self.kernel,
            self.dims,
            [*self.arrays, self.out],
            block_dim=self.block,
            device=self.device,
        )

    def outputs(self):
        return [self.out]

    def result(self):
        return [one.numpy().astype(float) for one in self.outputs()]

    def check(self, found):
        self.check_one(found[0])


def factors(device, n=20, count=50):
    rng = np.random.default_rng(1)
    g = rng.normal(size=(count, n, n))
    a, b = (g @ g.transpose(0, 2, 1) / n + np.eye(n)).astype("f4"), rng.normal(size=(count, n))
    expected = np.linalg.solve(a.astype(float), b.astype("f4").astype(float)[..., None])[..., 0]

    def check(x):
        assert np.abs(x - expected).max() < 1e-4 * np.abs(expected).max()

    return Tiles(device, make_factor(n), [a, b.astype("f4")], (count, n), float, check)


def transforms(device, n=256, count=40):
    x = np.random.default_rng(2).normal(size=(count, n, 2)).astype("f4")
    expected = np.fft.fft(x[..., 0].astype(float) + 1j * x[..., 1])

    def check(y):
        assert np.abs(y[..., 0] + 1j * y[..., 1] - expected).max() < 1e-5 * np.abs(expected).max()

    return Tiles(device, make_transform(n), [x], (count, n), wp.vec2, check)


class Products(Tiles):
    """A matrix, two blocks high and wide, of which the last ones stick out."""

    def __init__(self, device, dtype, tile, block):
        m, n, depth = tile
        rng = np.random.default_rng(5)
        # Few digits, which all types hold.
        a, b = (rng.integers(-32, 33, size) / 64.0 for size in ((m + 9, 96), (96, n + 16)))
        steps = -(-96 // depth)
        self.sum = wp.float64 if dtype is wp.float64 else wp.float32
        expected = 2 * a @ b, -a[:, :depth] @ b[:depth]

        def check(total, one):
            np.testing.assert_array_equal(total, expected[0])
            unit = {wp.float16: 2.0**-11, wp.bfloat16: 2.0**-8}.get(dtype, 0)
            assert np.all(np.abs(one - expected[1]) <= unit * np.abs(expected[1]))

        kernel = make_product(dtype, tile, steps)
        arrays = [np.asarray(v, dtype="f4" if dtype is wp.bfloat16 else None) for v in (a, b)]
        super().__init__(device, kernel, arrays, expected[0].shape, dtype, check, (2, 2), block)

    def prepare(self):
        super().prepare()
        self.total = wp.zeros(self.shape, dtype=self.sum, device=self.device)

    def launch(self):
        wp.launch_tiled(
            self.kernel,
            self.dims,
            [*self.arrays, self.out, self.total],
            block_dim=self.block,
            device=self.device,
        )

    def outputs(self):
        return [self.total, self.out]

    def check(self, found):
        self.check_one(*found)


PRODUCTS = {
    "floats": (wp.float32, (128, 128, 32), 256),
    "few floats": (wp.float32, (32, 64, 8), 64),
    "halves": (wp.float16, (128, 128, 32), 256),
    "short floats": (wp.bfloat16, (64, 64, 32), 128),
    "few halves": (wp.float16, (32, 32, 16), 64),
    "doubles": (wp.float64, (64, 32, 16), 128),
}


def products(name):
    return lambda device: Products(device, *PRODUCTS[name])


@pytest.fixture(
    params=[Searches, factors, transforms, *map(products, PRODUCTS)],
    ids=["searches", "factors", "transforms", *PRODUCTS],
)
def program(request, gpu, fresh_cache):
    made = request.param(gpu)
    wp.synchronize()
    for entry in fresh_cache.glob("*.code"):  # of the mesh and the hierarchy
        entry.unlink()
    return made


def same(one, other):
    return all(a.tobytes() == b.tobytes() for a, b in zip(one, other, strict=True))


def test_better_code_comes_with_the_second_launch(program, fresh_cache):
    program.launch()
    first = program.result()
    program.check(first)
    assert codes(fresh_cache) == 1
    program.prepare()
    program.launch()
    assert same(program.result(), first)
    _native.wait_for_background()
    assert codes(fresh_cache) == 2
    program.prepare()
    program.launch()
    assert same(program.result(), first)
    assert codes(fresh_cache) == 2


@pytest.mark.parametrize("is_known", [False, True], ids=["recorded first", "launched first"])
def test_graphs_go_over_to_the_better_code(program, fresh_cache, is_known):
    if is_known:
        program.launch()
        program.prepare()
    with wp.ScopedCapture(program.device) as capture:
        program.launch()
    wp.capture_launch(capture.graph)
    recorded = program.result()
    program.check(recorded)
    _native.wait_for_background()
    assert codes(fresh_cache) == 2
    for output in program.outputs():
        output.zero_()
    wp.capture_launch(capture.graph)
    assert capture.graph.native.provisional_launches == 0
    assert same(program.result(), recorded)


def test_branches_of_graphs_go_over_to_the_better_code(program, fresh_cache):
    branch = wp.ones(1, dtype=int, device=program.device)
    with wp.ScopedCapture(program.device) as inner:
        wp.capture_if(branch, on_true=program.launch)
    with wp.ScopedCapture(program.device) as outer:
        wp.capture_launch(inner.graph)
    for graph in (inner.graph, outer.graph):
        wp.capture_launch(graph)
    _native.wait_for_background()
    found = []
    for graph in (inner.graph, outer.graph):
        for output in program.outputs():
            output.zero_()
        wp.capture_launch(graph)
        assert graph.native.provisional_launches == 0
        found.append(program.result())
        program.check(found[-1])
    assert same(*found)


def test_blocks_that_need_fewer_registers_have_their_own_code(gpu, fresh_cache):
    program = factors(gpu)
    inputs = [*program.arrays, program.out]
    # `launch_tiled` would take blocks of a warp.
    extents = [program.shape[0], 1024]
    wp.launch(program.kernel, extents, inputs, block_dim=1024, device=gpu)
    program.check(program.result())
