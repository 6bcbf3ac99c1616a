"""Surfaces in fields on grids, as triangles."""

from warp._src.geometry.surfaces.marching_cubes import (
    IsoSurfaceMarchingCubes as IsoSurfaceMarchingCubes,
)
