"""Mesh generation - vertex indices of cells of dense grids.

Vertices are numbered with the last coordinate fastest; cells likewise.
"""

from __future__ import annotations

import numpy as np

# Corners of a square and a cube, counter-clockwise, bottom before top.
_SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
_CUBE = np.array([[*xy, z] for z in (0, 1) for xy in _SQUARE.tolist()])
# Corners 4 x + 2 y + z of five tetrahedra in a cube; every second cube is mirrored.
_TETS = np.array([[0, 1, 2, 4], [3, 2, 1, 7], [5, 1, 7, 4], [6, 7, 4, 2], [4, 1, 2, 7]])


def _vertices(resolution, corners):
    """Vertex numbers (cells, corners) of a grid's cells; corners may differ between cells."""
    for n in resolution:
        if n < 0:
            raise ValueError(f"expects resolutions >= 0, but got {tuple(resolution)}")
    cells = np.stack(np.meshgrid(*map(np.arange, resolution), indexing="ij"), -1)
    cells = cells.reshape(-1, len(resolution))
    strides = np.cumprod([1, *(n + 1 for n in resolution[:0:-1])])[::-1]
    return (cells[:, None, :] + corners) @ strides


def grid_to_quads(Nx: int, Ny: int):
    """Squares of a grid, counter-clockwise: an array (Nx Ny, 4) of vertex indices."""
    return _vertices((Nx, Ny), _SQUARE)


def grid_to_hexes(Nx: int, Ny: int, Nz: int):
    """Cubes of a grid, bottom before top, counter-clockwise: an array (Nx Ny Nz, 8)."""
    return _vertices((Nx, Ny, Nz), _CUBE)


def grid_to_tris(Nx: int, Ny: int):
    """Triangles of a grid, two a cell, counter-clockwise: an array (2 Nx Ny, 3).

    Cells follow each other along x, as programs that number triangles expect.
    """
    cells = _vertices((Nx, Ny), _SQUARE[[0, 1, 2, 0, 2, 3]])
    return cells.reshape(Nx, Ny, 6).transpose(1, 0, 2).reshape(-1, 3)


def grid_to_tets(Nx: int, Ny: int, Nz: int):
    """Tetrahedra of a grid, five a cell, conforming: an array (5 Nx Ny Nz, 4).

    Neighbours are mirror images, so that faces match; each has the other orientation.
    """
    resolution = (Nx, Ny, Nz)
    corners = (_TETS[..., None] >> np.array([2, 1, 0])) & 1
    parity = np.stack(np.meshgrid(*map(np.arange, resolution), indexing="ij"), -1) & 1
    mirrored = corners.reshape(1, 20, 3) ^ parity.reshape(-1, 1, 3)
    return _vertices(resolution, mirrored).reshape(-1, 4)
