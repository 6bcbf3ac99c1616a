"""Coarser meshes by clusters of vertices.

J. Rossignac and P. Borrel, Multi-resolution 3D approximations for rendering complex scenes, 1993.
"""

import numpy as np


def clustered(points, indices, wanted):
    """Vertices to keep and faces of them, about as many as wanted or fewer.

    Vertices in a cell of a grid become the first of them, so that a mesh which moves can be
    followed by the vertices that it keeps.
    """
    low, span = points.min(axis=0), float(np.ptp(points, axis=0).max())
    cells = max(2.0, float(np.sqrt(max(wanted, 1.0))))
    while True:
        grid = np.floor((points - low) * (cells / max(span, 1.0e-30))).astype(np.int64)
        keys = (grid[:, 0] << 42) + (grid[:, 1] << 21) + grid[:, 2]
        _, kept, number = np.unique(keys, return_index=True, return_inverse=True)
        faces = number.reshape(-1)[indices]
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
        # Faces that have come to lie on each other are drawn once.
        _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
        faces = faces[np.sort(first)]
        if len(faces) <= wanted or cells <= 2.0:
            return kept, faces
        cells *= 0.97 * min(0.9, float(np.sqrt(wanted / len(faces))))
