"""Surfaces in fields on grids and in volumes, as triangles or quads."""

from warp._src.geometry.surfaces.fields import IsoSurfaceBase as IsoSurfaceBase
from warp._src.geometry.surfaces.marching_cubes import (
    IsoSurfaceMarchingCubes as IsoSurfaceMarchingCubes,
)
from warp._src.geometry.surfaces.nets import IsoSurfaceNets as IsoSurfaceNets
from warp._src.geometry.surfaces.sparse import volume_marching_cubes as volume_marching_cubes
