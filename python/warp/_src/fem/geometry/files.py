"""Meshes from files - by meshio, where it is installed."""

from __future__ import annotations

import numpy as np

import warp as wp
from warp._src.fem.geometry.meshes import Hexmesh, Quadmesh, Tetmesh, Trimesh
from warp.extend import errors

_KINDS = {
    "tetra": (3, Tetmesh),
    "hexahedron": (3, Hexmesh),
    "triangle": (2, Trimesh),
    "quad": (2, Quadmesh),
}


def read_mesh(path, cell_type=None, scalar_type=wp.float32, device=None, build_bvh=False):
    """Reads a mesh of one kind of cells from a file.

    Args:
        path: name of a file of a format that meshio knows: Gmsh, VTK, Abaqus, XDMF and others.
        cell_type: "tetra", "hexahedron", "triangle" or "quad"; by default the only kind of the
            highest dimension in the file.
        scalar_type: `wp.float32` or `wp.float64`.
        device: device of the arrays.
        build_bvh: as of the meshes.

    Returns:
        A `Tetmesh`, `Hexmesh`, `Trimesh` or `Quadmesh`; the latter two are in the plane if the
        third coordinate is the same everywhere. Vertices that no cell has are left out.

    Raises:
        ImportError: meshio is not installed.
        ValueError: the file has no such cells, or several kinds.
    """
    try:
        import meshio
    except ImportError as problem:
        raise errors.absent("meshio", "'read_mesh'") from problem
    mesh = meshio.read(path)
    blocks: dict = {}
    for block in mesh.cells:
        if block.type in _KINDS and len(block.data):
            blocks.setdefault(block.type, []).append(block.data)
    if cell_type is None:
        top = max((_KINDS[name][0] for name in blocks), default=0)
        names = [name for name in blocks if _KINDS[name][0] == top]
        if len(names) > 1:
            raise ValueError(f"'{path}' has cells {' and '.join(names)}: choose by 'cell_type'")
        cell_type = names[0] if names else None
    if cell_type not in blocks:
        kinds = ", ".join(block.type for block in mesh.cells) or "none"
        raise ValueError(f"'{path}' has no cells of {cell_type or list(_KINDS)}, but {kinds}")
    cells = np.concatenate(blocks[cell_type])
    used, cells = np.unique(cells, return_inverse=True)
    dimension, kind = _KINDS[cell_type]
    points = np.asarray(mesh.points, float)[used]
    if dimension == 2 and (points.shape[1] == 2 or not np.ptp(points[:, 2])):
        points = points[:, :2]
    shape = (-1, np.concatenate(blocks[cell_type]).shape[1])
    table = wp.array(cells.reshape(shape).astype(np.int32), dtype=wp.int32, device=device)
    vector = wp.types.vector(points.shape[1], scalar_type)
    return kind(table, wp.array(points, dtype=vector, device=device), build_bvh=build_bvh)
