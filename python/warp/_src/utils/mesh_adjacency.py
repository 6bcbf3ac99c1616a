"""Edge adjacency of the triangles of a mesh."""

from __future__ import annotations

from warp.extend import checked
from warp.extend.kinds import COUNT, TRIPLES


class MeshEdge:
    """An edge from v0 to v1, as the first of its triangles goes around.

    Attributes:
        v0, v1: its vertices.
        o0, o1: the third vertices of the two triangles, -1 for the second if there is none.
        f0, f1: the numbers of the triangles, -1 likewise.
    """

    def __init__(self, v0, v1, o0, o1, f0, f1):
        self.v0, self.v1 = v0, v1
        self.o0, self.o1 = o0, o1
        self.f0, self.f1 = f0, f1


class MeshAdjacency:
    """The edges of triangles, by their two vertices in ascending order.

    Args:
        indices: three vertices per triangle.
        num_tris: accepted for compatibility.

    Attributes:
        edges: a `MeshEdge` by `(smaller vertex, larger vertex)`. For an edge with more than two
            triangles the first two count, and a line is printed.
    """

    @checked(indices=TRIPLES, num_tris=COUNT)
    def __init__(self, indices, num_tris):
        self.edges = {}
        self.indices = indices
        for face, (a, b, c) in enumerate(indices):
            for start, end, opposite in ((a, b, c), (b, c, a), (c, a, b)):
                self.add_edge(start, end, opposite, face)

    @checked(i0=COUNT, i1=COUNT, o=COUNT, f=COUNT)
    def add_edge(self, i0, i1, o, f) -> None:
        """Adds the edge from `i0` to `i1` of triangle `f`, whose third vertex is `o`."""
        key = (min(i0, i1), max(i0, i1))
        known = self.edges.get(key)
        if known is None:
            self.edges[key] = MeshEdge(i0, i1, o, -1, f, -1)
        elif known.f1 != -1:
            print("Detected non-manifold edge")
        else:
            known.o1, known.f1 = o, f
