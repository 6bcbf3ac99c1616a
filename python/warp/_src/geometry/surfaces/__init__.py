"""Surfaces of one value in scalar fields.

cases             which triangles a cell has
fields            what is inside, where edges are crossed
marching_cubes    `IsoSurfaceMarchingCubes`
nets              `IsoSurfaceNets`
sparse            `volume_marching_cubes`
"""
