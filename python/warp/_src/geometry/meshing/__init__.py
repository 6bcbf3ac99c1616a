"""Triangles from triangles: kernels and host classes in the public interface.

adjacency     `tri_tri_adjacency`: which triangles share an edge
delaunay      `delaunay_edge_flip`: flips of edges in the plane
swept         what moving meshes cover; `sweeps`: meshes and their poses
"""
