"""Reference cells - vertices, edges, faces and coordinates of the shapes that meshes consist of.

Coordinates of a point are three numbers for every cell: the parameters of lines, squares, cubes and
tetrahedra (missing ones are 0), the three barycentric coordinates of triangles. Vertices of squares
and cubes are numbered with the last axis first, (0, 0), (0, 1), (1, 0), (1, 1); `mesh_vertices`
says which column of a mesh's table of vertices each of them has.
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Cell:
    """A reference cell.

    Attributes:
        name: the cell's name, such as "triangle".
        dimension: number of parameters.
        is_simplex: True for points, lines, triangles and tetrahedra.
        corners: parameters of the vertices.
        edges: vertices of each edge, in the edge's direction.
        faces: vertices of each face; four are in the order of the vertices of a square.
        mesh_vertices: column of each vertex in a mesh's table.
        measure: length, area or volume in parameters.
    """

    name: str
    dimension: int
    is_simplex: bool
    corners: tuple
    edges: tuple
    faces: tuple
    mesh_vertices: tuple
    measure: float

    def __repr__(self):
        return self.name

    @functools.cached_property
    def vertices(self) -> np.ndarray:
        """Parameters of the vertices, (n, dimension)."""
        return np.array(self.corners, dtype=float).reshape(-1, self.dimension)

    @property
    def side(self) -> Cell:
        """The cell of the sides."""
        sides = {"line": POINT, "triangle": LINE, "square": LINE, "tetrahedron": TRIANGLE}
        return {**sides, "cube": SQUARE}[self.name]

    @property
    def sides(self) -> tuple:
        """Vertices of each side: of a line its ends, of a triangle its edges."""
        ends = tuple((v,) for v in range(len(self.corners)))
        return (ends, ends, self.edges, self.faces)[self.dimension]

    def entities(self, dimension: int) -> tuple:
        """Vertices of the entities of a dimension; the cell itself is the last."""
        whole = (tuple(range(len(self.corners))),)
        if dimension == self.dimension:
            return whole
        return (tuple((v,) for v in range(len(self.corners))), self.edges, self.faces)[dimension]

    @property
    def center(self) -> np.ndarray:
        """Coordinates of the centre, (3,)."""
        return self.coords(self.vertices.mean(axis=0)[None])[0]

    def parameters(self, coords) -> np.ndarray:
        """Parameters, (n, dimension), of points with these coordinates, (n, 3)."""
        coords = np.asarray(coords, dtype=float).reshape(-1, 3)
        return coords[:, 1:3] if self.name == "triangle" else coords[:, : self.dimension]

    def coords(self, parameters) -> np.ndarray:
        """Coordinates, (n, 3), of points with these parameters, (n, dimension)."""
        parameters = np.asarray(parameters, dtype=float).reshape(len(parameters), self.dimension)
        if self.name == "triangle":
            return np.column_stack((1.0 - parameters.sum(axis=1), parameters))
        return np.pad(parameters, ((0, 0), (0, 3 - self.dimension)))


def _box_entities(dimension):
    """Edges and faces of a square or cube, by axis, then by offsets in cyclic order of the axes."""

    def vertex(place):
        return functools.reduce(lambda number, bit: 2 * number + bit, place, 0)

    def along(axis, values):
        place = [0] * dimension
        for shift, value in enumerate(values):
            place[(axis + shift) % dimension] = value
        return vertex(place)

    edges, faces = [], []
    for axis in range(dimension):
        for offsets in itertools.product((0, 1), repeat=dimension - 1):
            edges.append((along(axis, (0, *offsets)), along(axis, (1, *offsets))))
        for offset in (0, 1) if dimension == 3 else ():
            places = itertools.product((0, 1), repeat=2)
            faces.append(tuple(along(axis, (offset, *place)) for place in places))
    return tuple(edges), tuple(faces)


def _simplex(name, dimension, edges, faces, measure):
    corners = ((0.0,) * dimension, *map(tuple, np.eye(dimension).tolist()))
    order = tuple(range(dimension + 1))
    return Cell(name, dimension, True, corners, edges, faces, order, measure)


def _box(name, dimension, mesh_vertices):
    corners = tuple(itertools.product((0.0, 1.0), repeat=dimension))
    edges, faces = _box_entities(dimension)
    return Cell(name, dimension, False, corners, edges, faces, mesh_vertices, 1.0)


_AROUND = ((0, 1), (1, 2), (2, 0))
_FACES = tuple((k, (k + 1) % 4, (k + 2) % 4) for k in range(4))

POINT = _simplex("point", 0, (), (), 1.0)
LINE = _simplex("line", 1, (), (), 1.0)
TRIANGLE = _simplex("triangle", 2, _AROUND, (), 0.5)
TET = _simplex("tetrahedron", 3, (*_AROUND, (0, 3), (1, 3), (2, 3)), _FACES, 1.0 / 6.0)
SQUARE = _box("square", 2, (0, 3, 1, 2))
CUBE = _box("cube", 3, (0, 4, 3, 7, 1, 5, 2, 6))

CELLS = (POINT, LINE, TRIANGLE, SQUARE, TET, CUBE)


@functools.cache
def cell(name: str) -> Cell:
    """The cell of a name.

    Raises:
        ValueError: there is none of that name.
    """
    for one in CELLS:
        if one.name == name:
            return one
    raise ValueError(f"no cell is named {name!r}; there are {', '.join(c.name for c in CELLS)}")


class Element:
    """Reference cells by kind."""

    LINE_SEGMENT = LINE
    SQUARE = SQUARE
    CUBE = CUBE
    TRIANGLE = TRIANGLE
    TETRAHEDRON = TET
