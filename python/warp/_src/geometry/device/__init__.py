"""What kernels build where it is asked: hash grids."""
