"""What kernels build and refit on the device: hash grids, hierarchies."""
