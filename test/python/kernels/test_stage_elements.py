"""Elements that a GPU's warps move together: matrices, spatial vectors, transforms.

Every launch is compared with NumPy. Sizes and block sizes leave warps with a few threads; threads
read and write what others move for them.
"""

import numpy as np
import pytest

import warp as wp

REALS = {wp.float16: np.float16, wp.float32: np.float32, wp.float64: np.float64}
SIZES = (1, 31, 33, 1000)
BLOCKS = (32, 48, 256)
SHAPES = ((2, 2), (3, 3), (4, 4), (2, 3), (6, 6), (5,), (6,), (8,))


def composite(shape, real):
    """The matrix or vector type of a shape."""
    if len(shape) == 2:
        return wp.types.matrix(shape, real)
    return wp.types.vector(shape[0], real)


def numbers(shape, real, seed=3):
    """Small integers, which all types hold exactly."""
    return np.random.default_rng(seed).integers(-9, 10, shape).astype(REALS[real])


def make(data, dtype, device, grad=False):
    return wp.array(data, dtype=dtype, device=device, requires_grad=grad)


def define_scale(element, real):
    @wp.kernel(module="unique")
    def scale(x: wp.array(dtype=element), y: wp.array(dtype=element), factor: real):
        i = wp.tid()
        y[i] = x[i] * factor

    return scale


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("shape", SHAPES)
def test_elements(shape, real, device):
    """Every element is loaded and stored by its thread, whatever the warps are like."""
    element = composite(shape, real)
    kernel = define_scale(element, real)
    for count in SIZES:
        for block in BLOCKS:
            x = numbers((count + 1, *shape), real)
            out = make(np.full_like(x, 77), element, device)
            inputs = [make(x, element, device), out, real(3.0)]
            wp.launch(kernel, count, inputs, device=device, block_dim=block)
            np.testing.assert_array_equal(out.numpy()[:count], 3 * x[:count])
            np.testing.assert_array_equal(out.numpy()[count], np.full(shape, 77))


@pytest.mark.parametrize("integer", [wp.uint8, wp.int16, wp.int32, wp.uint64])
def test_integers(integer, device):
    """Words of all sizes."""
    vector = wp.types.vector(7, integer)
    x = np.random.default_rng(9).integers(0, 40, (1000, 7)).astype(wp.dtype_to_numpy(integer))
    out = wp.zeros(1000, dtype=vector, device=device)
    inputs = [make(x, vector, device), out, integer(3)]
    wp.launch(define_scale(vector, integer), 1000, inputs, device=device)
    np.testing.assert_array_equal(out.numpy(), 3 * x)


@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("shape", SHAPES)
def test_gradients_of_elements(shape, real, device):
    """Stored values are taken, and added to loaded ones."""
    element = composite(shape, real)
    kernel = define_scale(element, real)
    for count in SIZES:
        x, y = (wp.zeros(count, element, device=device, requires_grad=True) for _ in range(2))
        before, seed = (numbers((count, *shape), wp.float32, number) for number in (3, 4))
        x.grad.assign(before)
        y.grad.assign(seed)
        inputs, adjoints = [x, y, real(3.0)], [x.grad, y.grad, None]
        wp.launch(kernel, count, inputs, adj_inputs=adjoints, adjoint=True, device=device)
        np.testing.assert_array_equal(x.grad.numpy(), before + 3 * seed)
        np.testing.assert_array_equal(y.grad.numpy(), np.zeros((count, *shape)))


@wp.kernel
def move(x: wp.array(dtype=wp.transform), y: wp.array(dtype=wp.transform), by: wp.transform):
    i = wp.tid()
    y[i] = wp.transform_multiply(by, x[i])


@pytest.mark.parametrize("count", SIZES)
def test_transforms(count, device):
    """Half turns about x, which only change signs."""
    x = numbers((count, 7), wp.float32)
    out = wp.zeros(count, dtype=wp.transform, device=device)
    turn = wp.transform(wp.vec3(1.0, 2.0, 3.0), wp.quat(1.0, 0.0, 0.0, 0.0))
    wp.launch(move, count, [make(x, wp.transform, device), out, turn], device=device)
    a, b, c, qx, qy, qz, qw = x.T
    expected = np.stack([a + 1, 2 - b, 3 - c, qw, -qz, qy, -qx], axis=1)
    np.testing.assert_array_equal(out.numpy(), expected)


@wp.kernel
def advance(x: wp.array(dtype=wp.mat33), steps: int):
    i = wp.tid()
    for _ in range(steps):
        x[i] = 2.0 * x[i] - wp.transpose(x[i])


@wp.kernel
def zigzag(x: wp.array(dtype=wp.mat33), y: wp.array(dtype=wp.mat33), out: wp.array(dtype=wp.mat33)):
    i = wp.tid()
    first = x[i]
    y[i] = 2.0 * first
    x[i][1, 2] = y[i][1, 1] + 1.0
    second = y[i]
    x[i] = wp.transpose(second)
    y[i][0, 1] = x[i][2, 0]
    out[i] = x[i] + first


@pytest.mark.parametrize("count", SIZES)
def test_in_place(count, device):
    """Loads see the thread's own stores, those in loops too."""
    x = numbers((count, 3, 3), wp.float32)
    array = make(x, wp.mat33, device)
    wp.launch(advance, count, [array, 5], device=device)
    for _ in range(5):
        x = 2 * x - x.transpose(0, 2, 1)
    np.testing.assert_array_equal(array.numpy(), x)


def follow_zigzag(x, y):
    """The result of `zigzag`, in NumPy; `x` and `y` may be the same array."""
    first = x.copy()
    y[:] = 2 * first
    x[:, 1, 2] = y[:, 1, 1] + 1
    second = y.copy()
    x[:] = second.transpose(0, 2, 1)
    y[:, 0, 1] = x[:, 2, 0]
    return x + first


@pytest.mark.parametrize("same", [False, True])
@pytest.mark.parametrize("count", SIZES)
def test_order_of_accesses(count, same, device):
    """Whole elements and components of one array, under two names, in order."""
    x = numbers((count, 3, 3), wp.float32)
    y = x if same else numbers((count, 3, 3), wp.float32, 4)
    arrays = [make(x, wp.mat33, device)]
    arrays += arrays if same else [make(y, wp.mat33, device)]
    out = wp.zeros(count, dtype=wp.mat33, device=device)
    wp.launch(zigzag, count, [*arrays, out], device=device)
    np.testing.assert_array_equal(out.numpy(), follow_zigzag(x, y))
    np.testing.assert_array_equal(arrays[0].numpy(), x)
    np.testing.assert_array_equal(arrays[1].numpy(), y)


@wp.kernel
def branches(
    x: wp.array(dtype=wp.mat33), flags: wp.array(dtype=int), n: int, out: wp.array(dtype=wp.mat33)
):
    i = wp.tid()
    if i < n:
        if flags[i] > 0:
            out[i] = 2.0 * x[i]
        elif flags[i] < 0:
            out[i] = -x[i]
    if flags[i] == 0:
        for j in range(i % 3):
            out[i] = out[i] + float(j + 1) * x[i]
    if i > 0:
        out[i] = out[i] + x[i - 1]


@pytest.mark.parametrize("count", SIZES)
def test_branches(count, device):
    """Threads of one warp part and meet again."""
    x = numbers((count, 3, 3), wp.float32)
    flags = numbers(count, wp.float32, 5).astype(np.int32) // 4
    flags[64:128] = 1
    n = max(1, count - 7)
    out = wp.zeros(count, dtype=wp.mat33, device=device)
    inputs = [make(x, wp.mat33, device), make(flags, int, device), n, out]
    wp.launch(branches, count, inputs, device=device)
    i = np.arange(count)
    factor = np.where(i < n, np.where(flags > 0, 2.0, np.where(flags < 0, -1.0, 0.0)), 0.0)
    factor += np.where(flags == 0, np.array([0.0, 1.0, 3.0])[i % 3], 0.0)
    expected = factor[:, None, None] * x
    expected[1:] += x[:-1]
    np.testing.assert_array_equal(out.numpy(), expected)


@wp.kernel
def neighbours(
    x: wp.array(dtype=wp.mat33),
    at: wp.array(dtype=int),
    out: wp.array(dtype=wp.mat33),
    back: wp.array(dtype=wp.mat33),
):
    i = wp.tid()
    n = out.shape[0]
    out[i] = x[i + 2] + 10.0 * x[i - 1] + 100.0 * x[2 * i] + 1000.0 * x[at[i]]
    back[n - 1 - i] = x[i % 5]


@pytest.mark.parametrize("count", SIZES)
def test_other_indices(count, device):
    """Shifted, wrapped, strided, reversed and looked-up elements."""
    x = numbers((2 * count + 2, 3, 3), wp.float32)
    at = np.random.default_rng(6).permutation(count).astype(np.int32)
    out, back = (wp.zeros(count, dtype=wp.mat33, device=device) for _ in range(2))
    inputs = [make(x, wp.mat33, device), make(at, int, device), out, back]
    wp.launch(neighbours, count, inputs, device=device)
    i = np.arange(count)
    expected = x[i + 2] + 10 * x[i - 1] + 100 * x[2 * i] + 1000 * x[at]
    np.testing.assert_array_equal(out.numpy(), expected)
    np.testing.assert_array_equal(back.numpy(), x[i % 5][::-1])


@wp.kernel
def grid2(x: wp.array2d(dtype=wp.mat33), y: wp.array2d(dtype=wp.mat33)):
    i, j = wp.tid()
    y[i, j] = x[i, j] + wp.transpose(x[0, j])


@wp.kernel
def grid3(x: wp.array3d(dtype=wp.mat33), y: wp.array3d(dtype=wp.mat33)):
    i, j, k = wp.tid()
    row = x[i][j]
    y[i, j, k] = 2.0 * row[k]


@wp.kernel
def turned(x: wp.array2d(dtype=wp.mat33), y: wp.array2d(dtype=wp.mat33)):
    i, j = wp.tid()
    y[j, i] = x[i, j]


@pytest.mark.parametrize("block", BLOCKS)
@pytest.mark.parametrize("shape", [(1, 1), (3, 31), (5, 33), (7, 64), (40, 100), (64, 16)])
def test_grids(shape, block, device):
    """The last index follows the threads of a row; a warp may hold parts of several."""
    x = numbers((*shape, 3, 3), wp.float32)
    array = make(x, wp.mat33, device)
    out = wp.zeros(shape, dtype=wp.mat33, device=device)
    wp.launch(grid2, shape, [array, out], device=device, block_dim=block)
    np.testing.assert_array_equal(out.numpy(), x + x[:1].transpose(0, 1, 3, 2))
    out = wp.zeros(shape[::-1], dtype=wp.mat33, device=device)
    wp.launch(turned, shape, [array, out], device=device, block_dim=block)
    np.testing.assert_array_equal(out.numpy(), x.transpose(1, 0, 2, 3))


@pytest.mark.parametrize("shape", [(2, 3, 31), (3, 2, 64), (9, 4, 33)])
def test_grids_of_three(shape, device):
    """Views of rows are arrays of their own."""
    x = numbers((*shape, 3, 3), wp.float32)
    out = wp.zeros(shape, dtype=wp.mat33, device=device)
    wp.launch(grid3, shape, [make(x, wp.mat33, device), out], device=device)
    np.testing.assert_array_equal(out.numpy(), 2 * x)


def test_strided_array(device):
    """Elements with gaps between them."""
    x = numbers((200, 3, 3), wp.float32)
    out = wp.zeros(100, dtype=wp.mat33, device=device)
    inputs = [make(x, wp.mat33, device)[::2], out, 3.0]
    wp.launch(define_scale(wp.mat33, wp.float32), 100, inputs, device=device)
    np.testing.assert_array_equal(out.numpy(), 3 * x[::2])


def define_energy(real, size):
    element = wp.types.matrix((size, size), real)

    @wp.kernel(module="unique")
    def energy(f: wp.array(dtype=element), e: wp.array(dtype=real), out: wp.array(dtype=element)):
        i = wp.tid()
        m = f[i]
        e[i] = wp.determinant(m) + wp.ddot(m, m)
        out[i] = wp.transpose(m) * m

    return energy


@pytest.mark.parametrize("real, tolerance", [(wp.float32, 2e-5), (wp.float64, 1e-13)])
@pytest.mark.parametrize("size", [2, 3, 4])
@pytest.mark.parametrize("count", SIZES)
def test_gradients(count, size, real, tolerance, device):
    """Gradients are added to what is there; those of what was stored are taken."""
    rng = np.random.default_rng(8)
    f = np.eye(size) + 0.3 * rng.random((count, size, size))
    seed, seeds = rng.random(count), rng.random((count, size, size))
    before = rng.random((count, size, size))
    kernel = define_energy(real, size)
    array = make(f, wp.types.matrix((size, size), real), device, True)
    e = wp.zeros(count, dtype=real, device=device, requires_grad=True)
    out = wp.zeros_like(array, requires_grad=True)
    array.grad.assign(before)
    e.grad.assign(seed)
    out.grad.assign(seeds)
    inputs = [array, e, out]
    adjoints = [item.grad for item in inputs]
    wp.launch(kernel, count, inputs, adj_inputs=adjoints, adjoint=True, device=device)
    inverse = np.linalg.inv(f).transpose(0, 2, 1)
    expected = before + seed[:, None, None] * (np.linalg.det(f)[:, None, None] * inverse + 2 * f)
    expected += f @ (seeds + seeds.transpose(0, 2, 1))
    np.testing.assert_allclose(array.grad.numpy(), expected, rtol=tolerance, atol=tolerance)
    np.testing.assert_array_equal(out.grad.numpy(), np.zeros((count, size, size)))
    np.testing.assert_array_equal(e.grad.numpy(), np.zeros(count))


COLUMNS = (1, 3, 20, 31, 32, 33)
MISSING = {
    "none": lambda j, n: j < 0,
    "all": lambda j, n: j >= 0,
    "all but one": lambda j, n: j != n // 2,
    "the first": lambda j, n: j == 0,
    "the last": lambda j, n: j == n - 1,
    "every other": lambda j, n: j % 2 == 0,
    "some": lambda j, n: j % 7 == 3,
}


def define_columns(element, other):
    @wp.kernel(module="unique")
    def columns(
        missing: wp.array(dtype=int),
        x: wp.array2d(dtype=element),
        y: wp.array2d(dtype=element),
        z: wp.array2d(dtype=other),
    ):
        i, j = wp.tid()
        if missing[j] == 1:
            return
        if missing[j] == 2:
            y[i, j] = -x[i, j]
        else:
            z[i, j] = z[i, j] + z[i, j]
            y[i, j] = x[i, j] + x[i, j]

    return columns


@pytest.mark.parametrize("missing", MISSING)
@pytest.mark.parametrize(
    ("shape", "other"),
    [((3, 3), (3, 3)), ((5,), (4, 4)), ((6,), (3, 3)), ((3, 3), (7,)), ((6, 6), (5,))],
)
def test_missing_columns(shape, other, missing, device):
    """Warps that lack threads move what they have, of two sizes on the sides of a branch."""
    element, second = composite(shape, wp.float32), composite(other, wp.float32)
    kernel = define_columns(element, second)
    for count in COLUMNS:
        out = MISSING[missing](np.arange(count), count)
        for absent in (1, 2):
            x = numbers((50, count, *shape), wp.float32)
            w = numbers((50, count, *other), wp.float32, 4)
            y, z = make(np.full_like(x, 77), element, device), make(w, second, device)
            absence = make(out.astype(np.int32) * absent, int, device)
            wp.launch(kernel, (50, count), [absence, make(x, element, device), y, z], device=device)
            expected = 2 * x
            expected[:, out] = 77 if absent == 1 else -x[:, out]
            np.testing.assert_array_equal(y.numpy(), expected)
            w[:, ~out] *= 2
            np.testing.assert_array_equal(z.numpy(), w)
