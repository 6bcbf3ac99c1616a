"""Exchange of arrays and kernels with other libraries."""
