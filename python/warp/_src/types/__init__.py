"""Types of kernels: scalars, vectors, matrices, structs, and annotations of parameters."""
