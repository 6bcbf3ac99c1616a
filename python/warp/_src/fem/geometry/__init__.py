"""Geometries: grids, meshes, sparse grids, their partitions, positions and look-up."""
