"""Meshes, hierarchies of boxes and hash grids: host classes, and queries in the kernel language.

handles       kinds of handles, and their slots in kernels
grid          `HashGrid`; `grid_queries`: what kernels ask it
bvh, mesh     `Bvh` and `Mesh`; `tree_queries`, `mesh_queries`: what kernels ask them;
              `mesh_arrays`, `mesh_derivatives`; `tile_queries`: what blocks ask together
surfaces      where fields, volumes and functions have one value
meshing       which triangles share an edge, flips of edges, what moving meshes cover
"""
