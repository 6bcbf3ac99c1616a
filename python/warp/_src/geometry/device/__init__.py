"""Builds and refits on the device by kernels: hash grids, hierarchies."""
