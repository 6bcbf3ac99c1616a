"""Closed meshes of spheres."""

import numpy as np


def sphere(n=12, center=(0.0, 0.0, 0.0), radius=1.0):
    """A closed sphere of 4 n (n - 1) faces, of which no edge is in a plane of the axes."""
    u, v = np.meshgrid(np.arange(2 * n), np.arange(1, n), indexing="ij")
    theta, phi = np.pi * v / n, np.pi * u / n + 0.1
    ring = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    points = np.concatenate([np.stack(ring, axis=-1).reshape(-1, 3), [[0, 0, 1], [0, 0, -1]]])
    north, south = len(points) - 2, len(points) - 1
    faces = []
    for i in range(2 * n):
        a, b = i * (n - 1), (i + 1) % (2 * n) * (n - 1)
        faces += [(north, a, b), (south, b + n - 2, a + n - 2)]
        for j in range(n - 2):
            faces += [(a + j, a + j + 1, b + j + 1), (a + j, b + j + 1, b + j)]
    return (points * radius + center).astype(np.float32), np.array(faces)
