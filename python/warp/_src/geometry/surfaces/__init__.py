"""Surfaces of one value in scalar fields.

cases             which triangles a cell has
fields            what is inside, where edges are crossed
marching_cubes    `IsoSurfaceMarchingCubes`
nets              `IsoSurfaceNets`
sparse            `volume_marching_cubes`
octree            `lipschitz_octree`: cells near the surface of a function
nodes, cells      `sparse_marching_cubes`, `sparse_marching_cubes_from_cells`
"""
