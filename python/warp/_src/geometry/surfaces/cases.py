"""The 256 cases of marching cubes, made of two rules.

Corners of a cell are in or out. In a face whose corners alternate, the corners that are in are cut
off one by one; both cells at a face decide alike, so the surface is closed. The cuts of all faces
join to loops through edges of the cell. A loop is cut into triangles by lines that lie in no face,
as the neighbour may have the same line there: then every edge has two triangles.
"""

from __future__ import annotations

import functools

import numpy as np

# Corners as offsets; edges as two corners, the lower one first.
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
EDGES = (
    *((0, 1), (1, 2), (3, 2), (0, 3), (4, 5), (5, 6), (7, 6), (4, 7)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)
# Corners of faces, counter-clockwise seen from outside.
_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))
_EDGE_OF = {frozenset(corners): edge for edge, corners in enumerate(EDGES)}
_FACES_OF = [
    {face for face, corners in enumerate(_FACES) if set(edge) <= set(corners)} for edge in EDGES
]


def _loops(case: int) -> list:
    """Closed paths through edges, around the corners that are in."""
    following = {}
    for corners in _FACES:
        inside = [case >> corner & 1 for corner in corners]
        # Walking around a face, each run of corners that are in has an edge where it begins and
        # one where it ends; a cut joins them.
        begins = [n for n in range(4) if inside[n] and not inside[n - 1]]
        for begin in begins:
            end = begin
            while inside[(end + 1) % 4]:
                end += 1
            first = _EDGE_OF[frozenset((corners[begin - 1], corners[begin]))]
            last = _EDGE_OF[frozenset((corners[end % 4], corners[(end + 1) % 4]))]
            following[first] = last
    loops = []
    while following:
        edge, loop = min(following), []
        while edge in following:
            loop.append(edge)
            edge = following.pop(edge)
        loops.append(loop)
    return loops


def _cuts(loop) -> list | None:
    """Triangles of a loop, or None if a line would lie in a face."""
    if len(loop) < 3:
        return []
    first, last = loop[0], loop[-1]
    for n in range(1, len(loop) - 1):
        apex = loop[n]
        sides = [(first, apex)] * (n > 1) + [(apex, last)] * (n < len(loop) - 2)
        if any(_FACES_OF[a] & _FACES_OF[b] for a, b in sides):
            continue
        before, behind = _cuts(loop[: n + 1]), _cuts(loop[n:])
        if before is not None and behind is not None:
            return [(first, apex, last), *before, *behind]
    return None


@functools.cache
def tables():
    """The starts of each case's triangles (257 numbers), and edges of all triangles (n, 3)."""
    starts, triangles = [0], []
    for case in range(256):
        for loop in _loops(case):
            triangles += _cuts(loop)
        starts.append(len(triangles))
    return np.array(starts, dtype=np.int32), np.array(triangles, dtype=np.int32)


@functools.cache
def public_tables():
    """The tables for code of users, where a corner's bit is set if its value is not less.

    Returns:
        Where the edges of each case start (257 numbers), and the edges of all triangles.
    """
    starts, triangles = tables()
    ranges, edges = [0], []
    for case in range(256):
        # A bit that is set there is clear here.
        edges += triangles[starts[255 - case] : starts[256 - case]].reshape(-1).tolist()
        ranges.append(len(edges))
    return tuple(ranges), tuple(edges)


@functools.cache
def loop_tables():
    """Tables of cases for surface nets, all int32.

    Returns:
        Where the loops of each case start (257 numbers); where the edges of each loop start (one
        more than there are loops); the edges of all loops; and for each case and edge the number of
        the loop through it among those of the case, or -1, of shape (256, 12).
    """
    starts, edge_starts, edges = [0], [0], []
    loop_of = np.full((256, len(EDGES)), -1, dtype=np.int32)
    for case in range(256):
        loops = _loops(case)
        for number, loop in enumerate(loops):
            edges += loop
            edge_starts.append(len(edges))
            loop_of[case, loop] = number
        starts.append(starts[-1] + len(loops))
    return *(np.array(table, dtype=np.int32) for table in (starts, edge_starts, edges)), loop_of


@functools.cache
def edges_around():
    """Per axis the cells around an edge, counter-clockwise, of shape (3, 4, 4).

    Each is the offset from the node that the edge starts from, and which edge of the cell it is.
    """
    found = np.zeros((3, 4, 4), dtype=np.int32)
    number = {tuple(place): edge for edge, place in enumerate(edge_places().tolist())}
    for axis in range(3):
        for n, (first, second) in enumerate(((1, 1), (0, 1), (0, 0), (1, 0))):
            start = [0, 0, 0]
            start[(axis + 1) % 3], start[(axis + 2) % 3] = first, second
            found[axis, n] = *(-x for x in start), number[(*start, axis)]
    return found


@functools.cache
def edge_places():
    """Per edge the node that it starts from, as an offset, and its axis."""
    places = [
        (*CORNERS[a], next(n for n in range(3) if CORNERS[a][n] != CORNERS[b][n])) for a, b in EDGES
    ]
    return np.array(places, dtype=np.int32)
