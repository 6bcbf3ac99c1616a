"""`delaunay_edge_flip`: flips edges of a plane triangulation until circles are empty.

A flip changes two triangles and what their outer neighbours know. In a pass each edge that should
flip claims these four, and flips if it has them all, so flips of a pass do not meet.
"""

from __future__ import annotations

import math

import warp as wp
from warp._src.argument_kinds import ARRAY, COUNT, NUMBER
from warp._src.arguments import checked
from warp._src.geometry.meshing.adjacency import (
    check_triangles,
    find_triangle_neighbor_edge_index,
    tri_tri_adjacency,
)

# Rounding of the determinant below in 64 bits, relative to the sum of its products: Shewchuk,
# "Adaptive precision floating-point arithmetic", 1997, (10 + 96 e) e with e = 2^-53.
_ROUNDING = 1.1102230246251577e-15


@wp.func
def _area(a: wp.vec2, b: wp.vec2, c: wp.vec2):
    """The area of a triangle, positive if its corners go counter-clockwise."""
    p = wp.vec2d(wp.float64(b[0]), wp.float64(b[1])) - wp.vec2d(wp.float64(a[0]), wp.float64(a[1]))
    q = wp.vec2d(wp.float64(c[0]), wp.float64(c[1])) - wp.vec2d(wp.float64(a[0]), wp.float64(a[1]))
    return wp.float64(0.5) * (p[0] * q[1] - p[1] * q[0])


@wp.func
def _is_in_circle(a: wp.vec2, b: wp.vec2, c: wp.vec2, d: wp.vec2):
    """True if d is inside the circle through a, b, c; not where rounding decides.

    So no two edges alternate, and points on one circle stay as they are.
    """
    at = wp.vec2d(wp.float64(d[0]), wp.float64(d[1]))
    p = wp.vec2d(wp.float64(a[0]), wp.float64(a[1])) - at
    q = wp.vec2d(wp.float64(b[0]), wp.float64(b[1])) - at
    r = wp.vec2d(wp.float64(c[0]), wp.float64(c[1])) - at
    det = (
        wp.dot(p, p) * (q[0] * r[1] - q[1] * r[0])
        + wp.dot(q, q) * (r[0] * p[1] - r[1] * p[0])
        + wp.dot(r, r) * (p[0] * q[1] - p[1] * q[0])
    )
    total = (
        wp.dot(p, p) * (wp.abs(q[0] * r[1]) + wp.abs(q[1] * r[0]))
        + wp.dot(q, q) * (wp.abs(r[0] * p[1]) + wp.abs(r[1] * p[0]))
        + wp.dot(r, r) * (wp.abs(p[0] * q[1]) + wp.abs(p[1] * q[0]))
    )
    return det > wp.float64(_ROUNDING) * total


@wp.func
def _swapped(x: wp.uint32, bits: int, mask: wp.uint32):
    """Neighbouring groups of bits exchanged."""
    return ((x >> wp.uint32(bits)) & mask) | ((x & mask) << wp.uint32(bits))


@wp.func
def _claim_of(triangle: int, side: int):
    """A number for an edge: not 0, different for each, in no order along the mesh."""
    x = wp.uint32(3 * triangle + side + 1)
    x = _swapped(x, 1, wp.uint32(0x55555555))
    x = _swapped(x, 2, wp.uint32(0x33333333))
    x = _swapped(x, 4, wp.uint32(0x0F0F0F0F))
    x = _swapped(x, 8, wp.uint32(0x00FF00FF))
    return (x >> wp.uint32(16)) | (x << wp.uint32(16))


@wp.func
def _should_flip(
    positions: wp.array(dtype=wp.vec2),
    reference: wp.array(dtype=wp.vec2),
    least: wp.float64,
    reference_least: wp.float64,
    a: int,
    b: int,
    c: int,
    d: int,
):
    """True if triangles cab and dba should become cad and dbc."""
    pa = positions[a]
    pb = positions[b]
    pc = positions[c]
    pd = positions[d]
    wanted = _area(pc, pa, pd) > least and _area(pc, pd, pb) > least
    wanted = wanted and _is_in_circle(pc, pa, pb, pd)
    if wanted and reference:
        ra = reference[a]
        rb = reference[b]
        rc = reference[c]
        rd = reference[d]
        wanted = wp.abs(_area(rc, ra, rd)) > reference_least
        wanted = wanted and wp.abs(_area(rc, rd, rb)) > reference_least
    return wanted


@wp.func
def _claim(claims: wp.array(dtype=wp.uint32), triangle: int, claim: wp.uint32):
    if triangle >= 0:
        wp.atomic_max(claims, triangle, claim)


@wp.kernel(enable_backward=False, module="unique")
def _claim_triangles(
    indices: wp.array2d(dtype=int),
    neighbors: wp.array2d(dtype=int),
    positions: wp.array(dtype=wp.vec2),
    reference: wp.array(dtype=wp.vec2),
    least: wp.float64,
    reference_least: wp.float64,
    claims: wp.array(dtype=wp.uint32),
):
    t = wp.tid()
    for side in range(3):
        other = neighbors[t, side]
        if other > t:
            back = find_triangle_neighbor_edge_index(neighbors, other, t)
            a = indices[t, (side + 1) % 3]
            b = indices[t, (side + 2) % 3]
            if back >= 0 and _should_flip(
                positions, reference, least, reference_least,
                a, b, indices[t, side], indices[other, back],
            ):  # fmt: skip
                claim = _claim_of(t, side)
                _claim(claims, t, claim)
                _claim(claims, other, claim)
                _claim(claims, neighbors[t, (side + 1) % 3], claim)
                _claim(claims, neighbors[other, (back + 1) % 3], claim)


@wp.func
def _has(claims: wp.array(dtype=wp.uint32), triangle: int, claim: wp.uint32):
    had = bool(True)
    if triangle >= 0:
        had = claims[triangle] == claim
    return had


@wp.kernel(enable_backward=False, module="unique")
def _flip(
    indices: wp.array2d(dtype=int),
    neighbors: wp.array2d(dtype=int),
    claims: wp.array(dtype=wp.uint32),
    flips: wp.array(dtype=int),
):
    t = wp.tid()
    for side in range(3):
        claim = _claim_of(t, side)
        # Rows may change under those who do not own them, so that is asked first.
        if claims[t] == claim:
            other = neighbors[t, side]
            if other > t and claims[other] == claim:
                back = find_triangle_neighbor_edge_index(neighbors, other, t)
                beyond = neighbors[t, (side + 1) % 3]
                behind = neighbors[other, (back + 1) % 3]
                if _has(claims, beyond, claim) and _has(claims, behind, claim):
                    c = indices[t, side]
                    indices[t, (side + 2) % 3] = indices[other, back]
                    indices[other, (back + 2) % 3] = c
                    neighbors[t, side] = behind
                    neighbors[t, (side + 1) % 3] = other
                    neighbors[other, back] = beyond
                    neighbors[other, (back + 1) % 3] = t
                    if behind >= 0:
                        at = find_triangle_neighbor_edge_index(neighbors, behind, other)
                        neighbors[behind, at] = t
                    if beyond >= 0:
                        at = find_triangle_neighbor_edge_index(neighbors, beyond, t)
                        neighbors[beyond, at] = other
                    wp.atomic_add(flips, 0, 1)


@wp.kernel(enable_backward=False, module="unique")
def _end_pass(
    flips: wp.array(dtype=int),
    most: int,
    total: wp.array(dtype=int),
    passes: wp.array(dtype=int),
    goes_on: wp.array(dtype=int),
):
    total[0] += flips[0]
    passes[0] += 1
    goes_on[0] = int(flips[0] > 0 and passes[0] < most)
    flips[0] = 0


def _check_least(name, value) -> None:
    if not (math.isfinite(value) and value >= 0.0):
        raise ValueError(f"expects {name} >= 0 and finite, but got {value}")


@checked(
    positions=ARRAY,
    indices=ARRAY,
    ref_positions=ARRAY,
    max_passes=COUNT,
    area_epsilon=NUMBER,
    ref_area_epsilon=NUMBER,
)
def delaunay_edge_flip(
    positions,
    indices,
    ref_positions=None,
    max_passes=1000,
    area_epsilon=0.0,
    ref_area_epsilon=1e-10,
):
    """Flips edges until no triangle's circle has the corner of a neighbour inside.

    `indices` are changed; positions stay. True if a point is inside a circle is computed in 64 bits
    and decided only beyond their rounding. It can be captured in a graph.

    Args:
        positions: of vertices, an array of vec2.
        indices: corners of triangles, an int32 array of shape (triangles, 3). They go
            counter-clockwise, and an edge belongs to two triangles at most.
        ref_positions: other positions, in which no flip may make a triangle without area.
        max_passes: how often to go through all edges at most.
        area_epsilon: the area that each triangle that a flip makes has to exceed.
        ref_area_epsilon: the same for `ref_positions`, of either sign.

    Returns:
        How many edges were flipped, an int32 array of one element.

    Raises:
        ValueError: shapes, devices or numbers are not as above.
        TypeError: `indices` are not of int32.
    """
    check_triangles(indices)
    device, count = indices.device, indices.shape[0]
    for name, given in (("positions", positions), ("ref_positions", ref_positions)):
        if given is not None and given.device != device:
            raise ValueError(
                f"expects '{name}' on '{device}', where indices are, but it is on '{given.device}'"
            )
    if max_passes < 1:
        raise ValueError(f"expects max_passes >= 1, but got {max_passes}")
    _check_least("area_epsilon", area_epsilon)
    _check_least("ref_area_epsilon", ref_area_epsilon)
    total = wp.zeros(1, dtype=int, device=device)
    if not count:
        return total
    neighbors = tri_tri_adjacency(indices, return_neighbor_edge_indices=False)
    claims = wp.empty(count, dtype=wp.uint32, device=device)
    flips, passes = (wp.zeros(1, dtype=int, device=device) for _ in range(2))
    goes_on = wp.ones(1, dtype=int, device=device)
    least = [wp.float64(area_epsilon), wp.float64(ref_area_epsilon)]

    def go_through():
        claims.zero_()
        given = [indices, neighbors, positions, ref_positions, *least, claims]
        wp.launch(_claim_triangles, count, inputs=given, device=device)
        wp.launch(_flip, count, inputs=[indices, neighbors, claims, flips], device=device)
        given = [flips, int(max_passes), total, passes, goes_on]
        wp.launch(_end_pass, 1, inputs=given, device=device)

    wp.capture_while(goes_on, go_through)
    return total
