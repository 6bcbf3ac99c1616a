"""Kernels of shapes.py over graphs: searches, ranks, labels, lists that a counter fills."""

import numpy as np

import warp as wp
from _shape_data import Case, case, differentiable, forward_only


def random_graph(data, n, degree):
    """Starts of rows and columns of a graph, whose degrees are random."""
    degrees = data.random.integers(0, 2 * degree, n)
    starts = np.concatenate([[0], np.cumsum(degrees)]).astype(np.int32)
    columns = data.random.integers(0, n, starts[-1]).astype(np.int32)
    return data.given(starts, int), data.given(columns, int), int(starts[-1])


@differentiable
def ranks_kernel(
    starts: wp.array(dtype=int), columns: wp.array(dtype=int), rank: wp.array(dtype=float),
    degree: wp.array(dtype=int), damping: float, out: wp.array(dtype=float),
):  # fmt: skip
    i = wp.tid()
    total = float(0.0)
    for e in range(starts[i], starts[i + 1]):
        j = columns[e]
        d = degree[j]
        if d > 0:
            total += rank[j] / float(d)
    out[i] = (1.0 - damping) + damping * total


@case
def ranks(data):
    """A step of page rank that gathers."""
    n = data.size(1 << 14, 1 << 20)
    starts, columns, edges = random_graph(data, n, 8)
    arrays = [starts, columns, data.real(n), data.integers(n, 0, 16), 0.85]
    return Case(ranks_kernel, n, arrays, [data.out(n)], edges, "edge")


@forward_only
def level_kernel(
    starts: wp.array(dtype=int), columns: wp.array(dtype=int), front: wp.array(dtype=int),
    level: int, found: wp.array(dtype=int), following: wp.array(dtype=int),
    count: wp.array(dtype=int),
):  # fmt: skip
    t = wp.tid()
    i = front[t]
    for e in range(starts[i], starts[i + 1]):
        j = columns[e]
        if wp.atomic_cas(found, j, 0, level) == 0:
            k = wp.atomic_add(count, 0, 1)
            following[k % following.shape[0]] = j


@case
def level(data):
    """One level of a search in breadth; the front is written by a counter."""
    n = data.size(1 << 14, 1 << 20)
    starts, columns, edges = random_graph(data, n, 8)
    front = data.random.permutation(n)[: n // 4].astype(np.int32)
    arrays = [starts, columns, data.given(front, int), 3]
    outs = [data.out(n, int, False), data.out(n, int, False), data.out(1, int, False)]
    return Case(level_kernel, n // 4, arrays, outs, edges // 4, "edge")


@forward_only
def relax_kernel(
    source: wp.array(dtype=int), target: wp.array(dtype=int), weight: wp.array(dtype=float),
    distance: wp.array(dtype=float), out: wp.array(dtype=float), changed: wp.array(dtype=int),
):  # fmt: skip
    e = wp.tid()
    d = distance[source[e]] + weight[e]
    j = target[e]
    if d < distance[j]:
        old = wp.atomic_min(out, j, d)
        if d < old:
            wp.atomic_add(changed, 0, 1)


@case
def relax(data):
    """Edges of a graph are relaxed, as Bellman and Ford do."""
    n, edges = data.size(1 << 13, 1 << 19), data.size(1 << 16, 1 << 22)
    arrays = [data.integers(edges, 0, n), data.integers(edges, 0, n), data.real(edges, grad=False)]
    arrays.append(data.real(n, high=5.0, grad=False))
    outs = [data.out(n, grad=False), data.out(1, int, False)]
    return Case(relax_kernel, edges, arrays, outs, edges, "edge")


@forward_only
def triangles_kernel(
    source: wp.array(dtype=int), target: wp.array(dtype=int), starts: wp.array(dtype=int),
    columns: wp.array(dtype=int), count: wp.array(dtype=wp.int64),
):  # fmt: skip
    e = wp.tid()
    a = starts[source[e]]
    b = starts[target[e]]
    last = starts[source[e] + 1]
    end = starts[target[e] + 1]
    found = int(0)
    while a < last and b < end:
        x = columns[a]
        y = columns[b]
        if x == y:
            found += 1
            a += 1
            b += 1
        elif x < y:
            a += 1
        else:
            b += 1
    wp.atomic_add(count, 0, wp.int64(found))


@case
def triangles(data):
    """Triangles of a graph: merges of sorted lists of neighbours."""
    n = data.size(1 << 11, 1 << 17)
    degrees = data.random.integers(1, 32, n)
    starts = np.concatenate([[0], np.cumsum(degrees)]).astype(np.int32)
    near = np.repeat(np.arange(n), degrees) + data.random.integers(1, 64, starts[-1])
    source = np.repeat(np.arange(n, dtype=np.int32), degrees)
    columns = (near % n).astype(np.int32)
    columns = columns[np.lexsort((columns, source))]
    arrays = [data.given(a, int) for a in (source, columns, starts, columns)]
    return Case(
        triangles_kernel, len(columns), arrays, [data.out(1, wp.int64, False)], len(columns), "edge"
    )


@forward_only
def roots_kernel(parent: wp.array(dtype=int), out: wp.array(dtype=int)):
    i = wp.tid()
    r = i
    while parent[r] != r:
        r = parent[r]
    out[i] = r


@case
def roots(data):
    """Roots of a forest, by walks from every node."""
    n = data.size(1 << 15, 1 << 21)
    parent = (np.arange(n) * data.random.random(n)).astype(np.int32)
    return Case(roots_kernel, n, [data.given(parent, int)], [data.out(n, int, False)], n, "node")


@forward_only
def pack_kernel(
    values: wp.array(dtype=float),
    limit: float,
    count: wp.array(dtype=int),
    out: wp.array(dtype=wp.vec2i),
):
    i = wp.tid()
    x = values[i]
    if x > limit:
        k = wp.atomic_add(count, 0, 1)
        out[k % out.shape[0]] = wp.vec2i(i, int(x * 1000.0))


@case
def pack(data):
    """Places of large numbers, collected by a counter."""
    n = data.size(1 << 18, 1 << 24)
    outs = [data.out(1, int, False), data.out(n, wp.vec2i, False)]
    return Case(pack_kernel, n, [data.real(n, grad=False), 0.7], outs, n, "number")


@differentiable
def attention_kernel(
    q: wp.array2d(dtype=float), k: wp.array2d(dtype=float), v: wp.array2d(dtype=float),
    starts: wp.array(dtype=int), columns: wp.array(dtype=int), out: wp.array2d(dtype=float),
):  # fmt: skip
    i, h = wp.tid()
    total = float(0.0)
    value = float(0.0)
    for e in range(starts[i], starts[i + 1]):
        j = columns[e]
        w = wp.exp(wp.tanh(q[i, h] * k[j, h]))
        total += w
        value += w * v[j, h]
    out[i, h] = value / (total + 1.0e-6)


@case
def attention(data):
    """Attention along edges of a graph, with heads as second dimension."""
    n, heads = data.size(1 << 11, 1 << 17), 8
    starts, columns, edges = random_graph(data, n, 8)
    arrays = [data.real((n, heads)) for _ in range(3)] + [starts, columns]
    return Case(attention_kernel, (n, heads), arrays, [data.out((n, heads))], edges * heads, "edge")
