"""Arrays of a thread whose indices come from counters of loops are in registers."""

import numpy as np
import pytest

import warp as wp

N = 16


@wp.kernel
def transform(x: wp.array2d(dtype=wp.vec2d), y: wp.array2d(dtype=wp.vec2d)):
    """Cooley and Tukey's, after a permutation by reversed bits."""
    i = wp.tid()
    re = wp.zeros(shape=(N,), dtype=wp.float64)
    im = wp.zeros(shape=(N,), dtype=wp.float64)
    for k in range(N):
        r = ((k & 1) << 3) | ((k & 2) << 1) | ((k & 4) >> 1) | ((k & 8) >> 3)
        re[r] = x[i, k][0]
        im[r] = x[i, k][1]
    half = int(1)
    for _s in range(4):
        for b in range(N // 2):
            j = b % half
            low = b // half * 2 * half + j
            high = low + half
            angle = -wp.PI * float(j) / float(half)
            c, s = wp.float64(wp.cos(angle)), wp.float64(wp.sin(angle))
            u = re[high] * c - im[high] * s
            v = re[high] * s + im[high] * c
            re[high] = re[low] - u
            im[high] = im[low] - v
            re[low] += u
            im[low] += v
        half *= 2
    for k in range(N):
        y[i, k] = wp.vec2d(re[k], im[k])


def test_a_transform_needs_no_memory():
    assert "warp.scratch" not in transform.ir("thread")
    assert ".local" not in transform.ir("ptx", arch=90)


def test_against_numpy(device):
    given = np.random.default_rng(1).normal(size=(40, N, 2))
    x = wp.array(given, dtype=wp.vec2d, device=device)
    y = wp.zeros((40, N), dtype=wp.vec2d, device=device)
    wp.launch(transform, dim=40, inputs=[x, y], device=device)
    found = y.numpy() @ [1, 1j]
    np.testing.assert_allclose(found, np.fft.fft(given @ [1, 1j]), rtol=1e-6, atol=1e-6)


@wp.kernel
def indices(q: wp.array(dtype=int), out: wp.array2d(dtype=int)):
    """Every operation on values known before a launch; with negative numbers."""
    i = wp.tid()
    a = wp.zeros(shape=(N,), dtype=int)
    for k in range(-9, 9):
        a[((k % 5) + 5) % N] += q[i]
        a[k // 4 + 3] += 2
        a[wp.min(k, 3) + 9] += k
        a[wp.where(k < 0, -k, k)] += 3 * k
        a[(k ^ 5) & 15] += 5
        a[((k + 9) << 1) % N] += 7
        a[(k + 9) >> 1] += 11
        a[(k - 7) / 3 + 6] += 13
    for k in range(N):
        out[i, k] = a[k]


def truncated(a, b):
    return int(a / b)


def test_operations_of_indices(device):
    q = np.array([1, -4, 100], dtype=np.int32)
    expected = np.zeros((3, N), dtype=int)
    for a, v in zip(expected, q, strict=True):
        for k in range(-9, 9):
            a[(k - 5 * truncated(k, 5) + 5) % N] += v
            a[k // 4 + 3] += 2
            a[min(k, 3) + 9] += k
            a[abs(k)] += 3 * k
            a[(k ^ 5) & 15] += 5
            a[((k + 9) << 1) % N] += 7
            a[(k + 9) >> 1] += 11
            a[truncated(k - 7, 3) + 6] += 13
    out = wp.zeros((3, N), dtype=int, device=device)
    inputs = [wp.array(q, dtype=int, device=device), out]
    wp.launch(indices, dim=3, inputs=inputs, device=device)
    np.testing.assert_array_equal(out.numpy(), expected)


@pytest.mark.parametrize("count", [0, 1, 5])
def test_loops_of_run_time_around(device, count):
    """A value known within an iteration stays so in each iteration."""

    @wp.kernel(module="unique")
    def rotate(m: int, out: wp.array(dtype=int)):
        a = wp.zeros(shape=(12,), dtype=int)
        for k in range(12):
            a[k] = k
        for _r in range(m):
            first = a[0]
            for k in range(11):
                a[k] = a[k + 1]
            a[11] = first
        for k in range(12):
            out[k] = a[k]

    out = wp.zeros(12, dtype=int, device=device)
    wp.launch(rotate, dim=1, inputs=[count, out], device=device)
    np.testing.assert_array_equal(out.numpy(), np.roll(np.arange(12), -count))
    assert "warp.scratch" not in rotate.ir("thread")


@wp.kernel
def nested(x: wp.array2d(dtype=float), y: wp.array2d(dtype=float)):
    """Loops that stay, in loops that are written out and below conditions of run time."""
    i = wp.tid()
    sums = wp.zeros(shape=(N,), dtype=float)
    for lane in range(3):
        part = wp.vec3()
        for c in range(3):
            part[c] = x[i, 3 * lane + c]
        if part[0] > 0.5:
            for c in range(3):
                sums[1 + c] += part[c]
                for d in range(3):
                    sums[4 + 3 * c + d] += part[c] * part[d]
        else:
            sums[0] += part[2]
    for k in range(N):
        y[i, k] = sums[k]


def test_loops_that_are_copied_several_times(device):
    given = np.random.default_rng(2).random((50, 9), np.float32)
    y = wp.zeros((50, N), dtype=float, device=device)
    wp.launch(nested, dim=50, inputs=[wp.array(given, device=device), y], device=device)
    expected = np.zeros((50, N))
    for row, out in zip(given.astype(np.float64).reshape(50, 3, 3), expected, strict=True):
        for part in row:
            if part[0] > 0.5:
                out[1:4] += part
                out[4:13] += np.outer(part, part).ravel()
            else:
                out[0] += part[2]
    np.testing.assert_allclose(y.numpy(), expected, rtol=1e-5)


normals_type = wp.types.matrix(shape=(6, 3), dtype=float)


@wp.func
def separated(a: wp.mat33, b: wp.mat33, between: wp.vec3):
    """The number of the first of six axes on which two unit boxes are apart, or -1."""
    normals = normals_type()
    for r in range(3):
        normals[r] = wp.vec3(a[0, r], a[1, r], a[2, r])
        normals[r + 3] = wp.vec3(b[0, r], b[1, r], b[2, r])
    for j in range(2):
        for k in range(3):
            axis = normals[3 * j + k]
            size = float(0.0)
            for i in range(2):
                for r in range(3):
                    size += wp.abs(wp.dot(normals[3 * i + r], axis))
            if wp.abs(wp.dot(between, axis)) > size:
                return 3 * j + k
    return -1


@wp.kernel
def boxes(
    a: wp.array(dtype=wp.mat33),
    b: wp.array(dtype=wp.mat33),
    d: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=int),
):
    i = wp.tid()
    out[i] = separated(a[i], b[i], d[i])


@wp.kernel
def breaks(
    x: wp.array2d(dtype=float), limit: float, y: wp.array(dtype=float), n: wp.array(dtype=int)
):
    """Sums elements in another order until the sum is above a limit; continues where negative."""
    i = wp.tid()
    kept = wp.zeros(shape=(N,), dtype=float)
    for k in range(N):
        kept[k] = x[i, k]
    total = float(0.0)
    last = int(-1)
    for k in range(0, N, 2):
        if kept[(5 * k + 3) % N] < 0.0:
            continue
        total += kept[(5 * k + 3) % N]
        last = k
        if total > limit:
            break
    y[i] = total
    n[i] = last


def test_loops_that_end_early(device):
    x = np.random.default_rng(3).uniform(-1.0, 2.0, (50, N)).astype(np.float32)
    for limit in (-1.0, 2.0, 100.0):
        y, n = (wp.zeros(50, dtype=t, device=device) for t in (float, int))
        wp.launch(breaks, 50, [wp.array(x, device=device), limit, y, n], device=device)
        for i in range(50):
            total, last = np.float32(0.0), -1
            for k in range(0, N, 2):
                value = x[i, (5 * k + 3) % N]
                if value < 0.0:
                    continue
                total, last = total + value, k
                if total > limit:
                    break
            assert (y.numpy()[i], n.numpy()[i]) == (total, last)


def test_returns_from_nested_loops(device):
    random = np.random.default_rng(4)
    a, b = (np.linalg.qr(random.standard_normal((300, 3, 3)))[0] for _ in range(2))
    d = random.uniform(-3.0, 3.0, (300, 3))
    normals = np.concatenate([a.swapaxes(1, 2), b.swapaxes(1, 2)], axis=1)
    sizes = np.abs(np.einsum("nij,nkj->nik", normals, normals)).sum(1)
    apart = np.abs(np.einsum("nij,nj->ni", normals, d)) - sizes
    # None is so near that rounding decides.
    assert np.abs(apart).min() > 1e-5
    expected = np.where((apart > 0).any(1), (apart > 0).argmax(1), -1)
    out = wp.zeros(300, dtype=int, device=device)
    given = [wp.array(m, dtype=wp.mat33, device=device) for m in (a, b)]
    wp.launch(boxes, 300, [*given, wp.array(d, dtype=wp.vec3, device=device), out], device=device)
    np.testing.assert_array_equal(out.numpy(), expected)
    assert len(set(expected)) == 7


@pytest.mark.parametrize("kernel", [boxes, breaks])
def test_loops_that_end_early_need_no_memory(kernel):
    assert "warp.scratch" not in kernel.ir("thread")
    assert ".local" not in kernel.ir("ptx", arch=90)


@wp.func
def edges_of(dim: int):
    return wp.where(
        dim == 3,
        wp.matrix(0, 1, 1, 2, 2, 0, 2, 3, 0, 3, 1, 3, shape=(6, 2), dtype=int),
        wp.matrix(1, 2, 2, 0, 0, 1, 0, 0, 0, 0, 0, 0, shape=(6, 2), dtype=int),
    )


@wp.kernel
def stretch(dims: wp.array[int], p: wp.array2d[float], k: wp.array[float], out: wp.array2d[float]):
    """As an element of a flexible body: loops have 3 or 6 iterations, by what the element is."""
    i = wp.tid()
    dim = dims[i]
    count = 3 if dim == 2 else 6
    edges = edges_of(dim)
    lengths = wp.vector(0.0, length=12, dtype=float)
    metric = wp.matrix(0.0, shape=(6, 6), dtype=float)
    at = int(0)
    for e in range(count):
        lengths[e] = p[i, edges[e, 0]] - p[i, edges[e, 1]]
        for f in range(e, count):
            metric[e, f] = k[at]
            metric[f, e] = k[at]
            at += 1
    for e in range(count):
        total = float(0.0)
        for f in range(count):
            total += metric[e, f] * lengths[f]
        out[i, e] = total


def test_loops_with_one_of_two_ends_need_no_memory():
    assert "warp.scratch" not in stretch.ir("thread")
    assert ".local" not in stretch.ir("ptx", arch=90)


def test_loops_with_one_of_two_ends(device):
    dims = np.array([2, 3, 3, 2, 7], dtype=np.int32)
    rng = np.random.default_rng(8)
    p, k = rng.normal(size=(5, 4)), rng.normal(size=21)
    expected = np.full((5, 6), -1.0)
    solid, flat = [(0, 1), (1, 2), (2, 0), (2, 3), (0, 3), (1, 3)], [(1, 2), (2, 0), (0, 1)]
    for row, (dim, q) in enumerate(zip(dims, p, strict=True)):
        count = 3 if dim == 2 else 6
        edges = solid if dim == 3 else flat + 3 * [(0, 0)]
        lengths = np.array([q[a] - q[b] for a, b in edges[:count]])
        metric = np.zeros((count, count))
        upper = np.triu_indices(count)
        metric[upper] = k[: len(upper[0])]
        metric.T[upper] = metric[upper]
        expected[row, :count] = metric @ lengths
    arrays = [wp.array(v, dtype=float, device=device) for v in (p, k)]
    out = wp.full((5, 6), -1.0, dtype=float, device=device)
    wp.launch(stretch, 5, [wp.array(dims, dtype=int, device=device), *arrays, out], device=device)
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-5, atol=1e-5)


@wp.kernel
def two_locals(n: wp.array[int], at: wp.array2d[int], x: wp.array2d[float], out: wp.array2d[float]):
    """One array of a thread has indices of run time, a longer one has counters alone."""
    i = wp.tid()
    picked = wp.zeros(shape=(10,), dtype=float)
    for j in range(n[i]):
        picked[at[i, j]] += x[i, j]
    sums = wp.zeros(shape=(12,), dtype=float)
    for j in range(12):
        sums[j] = x[i, j]
        for l in range(j):
            sums[j] += 0.5 * sums[l]
    for j in range(12):
        out[i, j] = sums[j] + picked[at[i, 0]]


def test_one_of_two_locals_stays_in_memory(device):
    text = two_locals.ir("thread")
    assert "warp.scratch<10 x f32>" in text and "warp.scratch<12 x f32>" not in text
    rng = np.random.default_rng(9)
    n = np.array([0, 3, 12], dtype=np.int32)
    at = rng.integers(0, 10, (3, 12)).astype(np.int32)
    x = rng.normal(size=(3, 12))
    expected = np.zeros((3, 12))
    for i in range(3):
        picked, sums = np.zeros(10), np.zeros(12)
        np.add.at(picked, at[i, : n[i]], x[i, : n[i]])
        for j in range(12):
            sums[j] = x[i, j] + 0.5 * sums[:j].sum()
        expected[i] = sums + picked[at[i, 0]]
    out = wp.zeros((3, 12), dtype=float, device=device)
    integers = [wp.array(v, dtype=int, device=device) for v in (n, at)]
    wp.launch(
        two_locals, 3, [*integers, wp.array(x, dtype=float, device=device), out], device=device
    )
    np.testing.assert_allclose(out.numpy(), expected, rtol=1e-5, atol=1e-5)
