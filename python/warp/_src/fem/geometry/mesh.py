"""Meshes - triangles, quadrilaterals, tetrahedra, hexahedra: one class of tables for all."""

from __future__ import annotations

from functools import cached_property

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import MAKERS, Geometry, GeometryRecord, forget
from warp._src.fem.geometry.entities import make_entities, make_sides
from warp._src.fem.geometry.hierarchy import HasHierarchy
from warp._src.fem.geometry.mesh_functions import mesh_functions
from warp._src.fem.geometry.shapes import VERTICES
from warp._src.fem.types import Ints, IntTable

MAKERS["mesh"] = mesh_functions


@wp.kernel(enable_backward=False)
def _find_bad_vertices(cells: IntTable, vertex_count: int, found: Ints):
    cell, k = wp.tid()
    v = cells[cell, k]
    if v < 0 or v >= vertex_count:
        wp.atomic_min(found, 0, cell * cells.shape[1] + k)


class MeshEntities:
    """Edges and faces of a mesh, made when they are asked for.

    Attributes:
        cells: (cells, n) of int32, vertices in the order of the reference cell.
        edges, faces: `EntityTable`s; `faces` is None in two dimensions.
        vertex_count, edge_count, face_count: numbers of entities.
        cell_edges, cell_faces: (cells, k) of int32, entities of each cell.
        edge_vertices, face_vertices: (entities, n) of int32, ascending; of squares the smallest
            first, then its smaller neighbour, its other neighbour, the opposite vertex.
    """

    aligned = False

    def __init__(self, vertex_count: int, cells, cell):
        self.vertex_count, self.cells, self._cell = vertex_count, cells, cell

    @cached_property
    def edges(self):
        return make_entities(self.cells, self._cell.edges, self.vertex_count)

    @cached_property
    def faces(self):
        if self._cell.dimension < 3:
            return None
        return make_entities(self.cells, self._cell.faces, self.vertex_count)

    @property
    def sides(self):
        return self.edges if self._cell.dimension < 3 else self.faces

    edge_count = property(lambda self: self.edges.count)
    cell_edges = property(lambda self: self.edges.of_cells)
    edge_vertices = property(lambda self: self.edges.vertices)
    face_count = property(lambda self: self.faces.count if self.faces else 0)
    cell_faces = property(lambda self: self.faces.of_cells if self.faces else None)
    face_vertices = property(lambda self: self.faces.vertices if self.faces else None)


class HasEntities:
    """Numbers of entities of geometries with tables: `_entities` of edges and faces, `_sides`."""

    def edge_count(self) -> int:
        """Number of edges."""
        return self._entities.edge_count

    def side_count(self) -> int:
        """Number of sides."""
        return self._sides.cells.shape[0]

    def boundary_side_count(self) -> int:
        """Number of sides with one cell."""
        return self._sides.boundary.shape[0]

    def entities(self, device=None) -> MeshEntities:
        """Vertices of cells, edges and faces, on the device of the geometry."""
        return self._entities


def _checked_cells(name: str, cells, width: int) -> wp.array:
    if not extend.is_array(cells):
        raise TypeError(f"'{name}' expects an array, but got {extend.shown(cells)}")
    if cells.ndim == 1 and extend.type_is_vector(cells.dtype):
        cells = cells.view(wp.int32).reshape((cells.shape[0], -1))
    if cells.ndim != 2 or cells.shape[1] != width or cells.dtype is not wp.int32:
        raise ValueError(
            f"'{name}' expects an array of int32 of shape (cells, {width}), but got "
            f"{extend.type_repr(cells.dtype)} of shape {cells.shape}"
        )
    return cells


def _checked_positions(positions, cells, dimensions: tuple) -> None:
    if not extend.is_array(positions):
        raise TypeError(f"'positions' expects an array, but got {extend.shown(positions)}")
    dtype = positions.dtype
    fits = extend.type_is_vector(dtype) and positions.ndim == 1 and dtype._length_ in dimensions
    if not fits or extend.type_scalar_type(dtype) not in (wp.float32, wp.float64):
        names = " or ".join(f"vec{d} (or vec{d}d)" for d in dimensions)
        raise ValueError(
            f"'positions' expects an array (vertices,) of {names}, but got "
            f"{extend.type_repr(dtype)} of shape {positions.shape}"
        )
    if positions.device != cells.device:
        raise ValueError(
            f"'positions' expects an array on {cells.device}, where the cells are, "
            f"but got one on {positions.device}"
        )


class Mesh(HasHierarchy, HasEntities, Geometry):
    """Base of meshes: a table of vertices of cells, and positions of vertices."""

    _shape = ""
    _dimensions: tuple = (3,)
    _name = "cells"

    def __init__(
        self, cells, positions, build_bvh=False, affine=False, cell_env=None, env_count=None
    ):
        cells = _checked_cells(self._name, cells, VERTICES[self._shape])
        _checked_positions(positions, cells, self._dimensions)
        self._cells, self._positions = cells, positions
        self._check_vertices()
        self._cell_env = self._checked_environments(cell_env, env_count)
        self.record = GeometryRecord(
            "mesh",
            self._shape,
            positions.dtype._length_,
            extend.type_scalar_type(positions.dtype),
            affine or self._shape in ("triangle", "tet"),
            self._environments > 1,
        )
        if build_bvh:
            self.build_bvh(positions.device)

    def _check_vertices(self) -> None:
        """Raises ValueError for the first vertex that the mesh does not have."""
        cells, n = self._cells, self.vertex_count()
        if cells.device.is_cpu:
            # NumPy takes less than the kernel would take to compile.
            bad = (cells.numpy() < 0) | (cells.numpy() >= n)
            first = int(bad.argmax()) if bad.any() else 2**31 - 1
        else:
            with extend.unrecorded():
                found = wp.full(1, 2**31 - 1, dtype=wp.int32, device=cells.device)
                wp.launch(_find_bad_vertices, cells.shape, [cells, n, found], device=cells.device)
                first = int(found.numpy()[0])
        if first < 2**31 - 1:
            cell, k = divmod(first, cells.shape[1])
            vertex = int(cells[cell : cell + 1].numpy()[0, k])
            raise ValueError(
                f"Vertex index {vertex} of cell {cell}, at flattened array index {first}, is not "
                f"of the mesh: expected a value in [0, {n})"
            )

    def _checked_environments(self, cell_env, env_count):
        if cell_env is None:
            if env_count not in (None, 1):
                raise ValueError(f"'env_count' {env_count} expects 'cell_env', but got None")
            return None
        if env_count is None or env_count < 1:
            raise ValueError(
                f"Environment count must be provided with 'cell_env', but got {env_count}"
            )
        shape = (self.cell_count(),)
        if not extend.is_array(cell_env) or cell_env.shape != shape or cell_env.dtype != wp.int32:
            raise ValueError(
                f"'cell_env' expects an array {shape} of dtype wp.int32, one entry per cell"
            )
        if not cell_env.is_contiguous:
            raise ValueError("'cell_env' expects a contiguous array")
        if cell_env.device != self._cells.device:
            raise RuntimeError(
                f"'cell_env' expects an array on {self._cells.device}, but got {cell_env.device}"
            )
        values = cell_env.numpy()
        if len(values) and not 0 <= values.min() <= values.max() < env_count:
            bad = int(np.flatnonzero((values < 0) | (values >= env_count))[0])
            raise ValueError(
                f"'cell_env' expects numbers below {env_count}, but cell {bad} has {values[bad]}"
            )
        self._environments = int(env_count)
        return cell_env

    @property
    def cell_env(self):
        """Environment of each cell, or None."""
        return self._cell_env

    @property
    def positions(self) -> wp.array:
        """Positions of the vertices; a new array of the same type and size may be set."""
        return self._positions

    @positions.setter
    def positions(self, positions) -> None:
        _checked_positions(positions, self._cells, (self.dimension,))
        if positions.shape != self._positions.shape or positions.dtype != self._positions.dtype:
            raise ValueError(
                f"'positions' expects {self._positions.shape[0]} elements of "
                f"{extend.type_repr(self._positions.dtype)}, but got {positions.shape[0]} of "
                f"{extend.type_repr(positions.dtype)}"
            )
        self._positions = positions
        forget(self)

    def cell_count(self) -> int:
        """Number of cells."""
        return self._cells.shape[0]

    def vertex_count(self) -> int:
        """Number of vertices, used or not."""
        return self._positions.shape[0]

    def side_count(self) -> int:
        """Number of sides."""
        return self._entities.sides.count

    @property
    def cell_vertices(self) -> wp.array:
        """(cells, n) of int32: the vertices of each cell, as the mesh was given."""
        return self._cells

    @cached_property
    def _ordered_cells(self) -> wp.array:
        """The cells in the order of the reference cell's vertices."""
        cells, columns = self._cells, self.cell.mesh_vertices
        if list(columns) == sorted(columns):
            return cells
        with extend.unrecorded():
            ordered = wp.empty(cells.shape, dtype=wp.int32, device=cells.device)
            for k, column in enumerate(columns):
                wp.copy(ordered[:, k], cells[:, column])
        return ordered

    @cached_property
    def _entities(self) -> MeshEntities:
        return MeshEntities(self.vertex_count(), self._ordered_cells, self.cell)

    @cached_property
    def _sides(self):
        return make_sides(self._entities.sides, self._cells, self._positions)

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        arg.cells = self._cells.to(device)
        arg.positions = self._positions.to(device)
        if self._cell_env is not None:
            arg.cell_env = self._cell_env.to(device)
        self._fill_hierarchy(arg, device)

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        sides = self._sides
        self.fill_cell_arg(arg.cell_arg, device)
        arg.side_vertices = sides.vertices.to(device)
        arg.side_corners = sides.corners.to(device)
        arg.side_cells = sides.cells.to(device)
        arg.boundary = sides.boundary.to(device)
