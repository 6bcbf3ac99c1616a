"""Meshes by shape of cell: triangles, quadrilaterals, tetrahedra, hexahedra."""

from __future__ import annotations

from warp._src.fem.geometry.mesh import Mesh

_cells = property(lambda self: self._cells, doc="(cells, n): vertices of each cell.")
_side_vertices = property(lambda self: self._sides.vertices, doc="(sides, n): their vertices.")
_side_cells = property(lambda self: self._sides.cells, doc="(sides,): inner and outer cell.")
_cell_edges = property(lambda self: self._entities.cell_edges, doc="(cells, n): their edges.")


class Trimesh(Mesh):
    """Triangles in the plane or in space.

    Args:
        tri_vertex_indices: (cells, 3) of int32.
        positions: (vertices,) of vec2, vec3, vec2d or vec3d.
        build_bvh: `build_bvh` at once, as `lookup` needs it.
        temporary_store: ignored.
        cell_env: (cells,) of int32, the environment of each cell.
        env_count: number of environments.

    Raises:
        ValueError: a vertex out of range, named with its cell, or arrays of the wrong type.
    """

    _shape, _dimensions, _name = "triangle", (2, 3), "tri_vertex_indices"

    def __init__(
        self,
        tri_vertex_indices,
        positions,
        build_bvh: bool = False,
        temporary_store=None,
        cell_env=None,
        env_count: int | None = None,
    ):
        super().__init__(tri_vertex_indices, positions, build_bvh, False, cell_env, env_count)

    tri_vertex_indices, edge_vertex_indices, edge_tri_indices = _cells, _side_vertices, _side_cells


class Trimesh2D(Trimesh):
    """Triangles in the plane, see `Trimesh`."""

    _dimensions = (2,)


class Trimesh3D(Trimesh):
    """Triangles in space, see `Trimesh`."""

    _dimensions = (3,)


class Quadmesh(Mesh):
    """Quadrilaterals in the plane or in space, vertices around each.

    Args:
        quad_vertex_indices: (cells, 4) of int32.
        positions, build_bvh, temporary_store, cell_env, env_count: as of `Trimesh`.

    Raises:
        ValueError: a vertex out of range, named with its cell, or arrays of the wrong type.
    """

    _shape, _dimensions, _name = "square", (2, 3), "quad_vertex_indices"

    def __init__(
        self,
        quad_vertex_indices,
        positions,
        build_bvh: bool = False,
        temporary_store=None,
        cell_env=None,
        env_count: int | None = None,
    ):
        super().__init__(quad_vertex_indices, positions, build_bvh, False, cell_env, env_count)

    quad_vertex_indices = _cells
    edge_vertex_indices, edge_quad_indices = _side_vertices, _side_cells


class Quadmesh2D(Quadmesh):
    """Quadrilaterals in the plane, see `Quadmesh`."""

    _dimensions = (2,)


class Quadmesh3D(Quadmesh):
    """Quadrilaterals in space, see `Quadmesh`."""

    _dimensions = (3,)


class Tetmesh(Mesh):
    """Tetrahedra.

    Args:
        tet_vertex_indices: (cells, 4) of int32.
        positions: (vertices,) of vec3 or vec3d.
        build_bvh, temporary_store, cell_env, env_count: as of `Trimesh`.

    Raises:
        ValueError: a vertex out of range, named with its cell, or arrays of the wrong type.
    """

    _shape, _name = "tet", "tet_vertex_indices"

    def __init__(
        self,
        tet_vertex_indices,
        positions,
        build_bvh: bool = False,
        temporary_store=None,
        cell_env=None,
        env_count: int | None = None,
    ):
        super().__init__(tet_vertex_indices, positions, build_bvh, False, cell_env, env_count)

    tet_vertex_indices, face_vertex_indices = _cells, _side_vertices
    face_tet_indices, tet_edge_indices = _side_cells, _cell_edges


class Hexmesh(Mesh):
    """Hexahedra: four vertices around the bottom, four above them.

    Args:
        hex_vertex_indices: (cells, 8) of int32.
        positions: (vertices,) of vec3 or vec3d.
        assume_parallelepiped_cells: opposite faces are parallel; other vertices are not read.
        build_bvh, temporary_store, cell_env, env_count: as of `Trimesh`.

    Raises:
        ValueError: a vertex out of range, named with its cell, or arrays of the wrong type.
    """

    _shape, _name = "cube", "hex_vertex_indices"

    def __init__(
        self,
        hex_vertex_indices,
        positions,
        assume_parallelepiped_cells: bool = False,
        build_bvh: bool = False,
        temporary_store=None,
        cell_env=None,
        env_count: int | None = None,
    ):
        self.parallelepiped_cells = bool(assume_parallelepiped_cells)
        super().__init__(
            hex_vertex_indices, positions, build_bvh, self.parallelepiped_cells, cell_env, env_count
        )

    hex_vertex_indices, face_vertex_indices = _cells, _side_vertices
    face_hex_indices, hex_edge_indices = _side_cells, _cell_edges
