"""Surfaces of one value in scalar fields.

cases             which triangles a cell has
marching_cubes    `IsoSurfaceMarchingCubes`
"""
