"""Kernels of shapes.py over rows, most of different lengths: graphs, attention, filters, texts."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only

BINS = 8
Counts = wp.types.vector(BINS, float)


def rows(data, n, most):
    """First elements of rows of random lengths, and the end of the last row."""
    return np.r_[0, data.random.integers(0, most, n).cumsum()]


@differentiable
def page_rank_kernel(
    begin: wp.array(dtype=int), target: wp.array(dtype=int), rank: wp.array(dtype=float),
    weight: wp.array(dtype=float), out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    s = float(0.0)
    for e in range(begin[i], begin[i + 1]):
        j = target[e]
        s += weight[e] * rank[j] / float(begin[j + 1] - begin[j] + 1)
    out[i] = 0.15 + 0.85 * s


@case
def page_rank(data):
    """An iteration of PageRank, pulled along the edges of each node."""
    n = data.size(1 << 13, 1 << 20)
    begin = rows(data, n, 24)
    edges = int(begin[-1])
    arrays = [data.given(begin, int), data.integers(edges, 0, n), data.real(n), data.real(edges)]
    return Case(page_rank_kernel, n, arrays, [data.out(n)], edges, "edge")


@differentiable
def attention_kernel(
    begin: wp.array(dtype=int), query: wp.array(dtype=wp.vec4), key: wp.array(dtype=wp.vec4),
    value: wp.array(dtype=float), out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    q = query[i]
    most = float(-1.0e30)
    for j in range(begin[i], begin[i + 1]):
        most = wp.max(most, wp.dot(q, key[j]))
    s = float(0.0)
    t = float(0.0)
    for j in range(begin[i], begin[i + 1]):
        w = wp.exp(wp.dot(q, key[j]) - most)
        s += w * value[j]
        t += w
    if t > 0.0:
        out[i] = s / t
    else:
        out[i] = 0.0


@case
def ragged_attention(data):
    """Softmax over keys of each query's own."""
    n = data.size(1 << 12, 1 << 19)
    begin = rows(data, n, 20)
    keys = int(begin[-1])
    arrays = [
        data.given(begin, int), data.real((n, 4), wp.vec4), data.real((keys, 4), wp.vec4),
        data.real(keys),
    ]  # fmt: skip
    return Case(attention_kernel, n, arrays, [data.out(n)], keys, "key")


@differentiable
def histogram_kernel(
    begin: wp.array(dtype=int), x: wp.array(dtype=float), weight: wp.array(dtype=float),
    out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    counts = Counts()
    for e in range(begin[i], begin[i + 1]):
        b = wp.min(int(x[e] * float(BINS)), BINS - 1)
        counts[b] = counts[b] + weight[e]
    s = float(0.0)
    for b in range(BINS):
        s += counts[b] * counts[b] + 0.1 * wp.log(counts[b] + 1.0)
    out[i] = s


@case
def ragged_histograms(data):
    """A histogram in local memory for each row."""
    n = data.size(1 << 12, 1 << 19)
    begin = rows(data, n, 30)
    entries = int(begin[-1])
    arrays = [data.given(begin, int), data.real(entries, grad=False), data.real(entries)]
    return Case(histogram_kernel, n, arrays, [data.out(n)], entries, "entry")


@differentiable
def tracking_kernel(
    z: wp.array2d(dtype=float), noise: wp.array(dtype=float), mean: wp.array2d(dtype=float),
    variance: wp.array2d(dtype=float),
):  # fmt: skip
    i = wp.tid()
    x = float(0.0)
    p = float(1.0)
    for t in range(z.shape[1]):
        p = p + noise[i]
        k = p / (p + 0.5)
        x = x + k * (z[i, t] - x)
        p = (1.0 - k) * p
        mean[i, t] = x
        variance[i, t] = p


@case
def tracking(data):
    """A filter with two states along rows."""
    n, steps = data.size(1 << 10, 1 << 16), 60
    arrays = [data.real((n, steps)), data.real(n)]
    outputs = [data.out((n, steps)), data.out((n, steps))]
    return Case(tracking_kernel, n, arrays, outputs, n * steps, "step")


@forward_only
def hash_kernel(
    text: wp.array2d(dtype=wp.uint8), n: int, out: wp.array(dtype=wp.uint32)
):  # fmt: skip
    i = wp.tid()
    h = wp.uint32(2166136261)
    for k in range(n):
        h = (h ^ wp.uint32(text[i, k])) * wp.uint32(16777619)
    out[i] = h


@case
def text_hashes(data):
    """FNV hashes of rows of bytes."""
    n, length = data.size(1 << 12, 1 << 18), 72
    text = data.given(data.random.integers(0, 256, (n, length)).astype(np.uint8), wp.uint8)
    out = data.out(n, wp.uint32, grad=False)
    return Case(hash_kernel, n, [text, length], [out], n * length, "byte")
