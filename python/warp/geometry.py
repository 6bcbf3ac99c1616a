"""Surfaces in fields, volumes and functions; triangulations; what moving meshes cover."""

from warp._src.geometry.meshing.adjacency import (
    find_triangle_neighbor_edge_index as find_triangle_neighbor_edge_index,
)
from warp._src.geometry.meshing.adjacency import tri_tri_adjacency as tri_tri_adjacency
from warp._src.geometry.meshing.delaunay import delaunay_edge_flip as delaunay_edge_flip
from warp._src.geometry.meshing.swept import SweptVolumeSignMode as SweptVolumeSignMode
from warp._src.geometry.meshing.swept import swept_volume_bounds as swept_volume_bounds
from warp._src.geometry.meshing.swept import swept_volume_field as swept_volume_field
from warp._src.geometry.meshing.swept import swept_volume_mesh as swept_volume_mesh
from warp._src.geometry.meshing.swept import swept_volume_sdf as swept_volume_sdf
from warp._src.geometry.surfaces.cells import sparse_marching_cubes as sparse_marching_cubes
from warp._src.geometry.surfaces.cells import (
    sparse_marching_cubes_from_cells as sparse_marching_cubes_from_cells,
)
from warp._src.geometry.surfaces.fields import IsoSurfaceBase as IsoSurfaceBase
from warp._src.geometry.surfaces.marching_cubes import (
    IsoSurfaceMarchingCubes as IsoSurfaceMarchingCubes,
)
from warp._src.geometry.surfaces.nets import IsoSurfaceNets as IsoSurfaceNets
from warp._src.geometry.surfaces.octree import lipschitz_octree as lipschitz_octree
from warp._src.geometry.surfaces.sparse import volume_marching_cubes as volume_marching_cubes
