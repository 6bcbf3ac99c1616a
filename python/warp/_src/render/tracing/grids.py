"""Triangles of height fields and tubes."""

import numpy as np


class HeightField:
    """Triangles over a grid of heights along the scene's `up`."""

    def __init__(self, scene, heights, low, high):
        axis = int(np.argmax(np.abs(scene.up)))
        if not np.allclose(np.abs(scene.up), np.eye(3)[axis]):
            raise ValueError(f"expects a scene whose 'up' is an axis, but got {scene.up}")
        heights = _values(heights)
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise ValueError(f"expects heights of shape (n, m), 2 or more, but got {heights.shape}")
        self.shape, self.axis, self.sign = heights.shape, axis, float(scene.up[axis])
        sides = [np.linspace(low[k], high[k], heights.shape[k]) for k in range(2)]
        self.grid = np.meshgrid(*sides, indexing="ij")
        self.others = [k for k in range(3) if k != axis]

    def points(self, heights):
        heights = _values(heights)
        if heights.shape != self.shape:
            raise ValueError(f"expects heights of shape {self.shape}, but got {heights.shape}")
        points = np.empty((*self.shape, 3), np.float32)
        points[..., self.others[0]], points[..., self.others[1]] = self.grid
        points[..., self.axis] = self.sign * heights
        return points.reshape(-1, 3)

    def indices(self):
        n, m = self.shape
        first = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).reshape(-1)
        a, b, c, d = first, first + m, first + m + 1, first + 1
        faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3)
        # The first axis crossed with the second is up for z and down for y.
        if (self.axis == 1) == (self.sign > 0.0):
            faces = faces[:, ::-1]
        return np.ascontiguousarray(faces, dtype=np.int32).reshape(-1)


def _values(heights):
    return heights.numpy() if hasattr(heights, "numpy") else np.asarray(heights)


def tubes(lines, radius, sides):
    """Points and indices of tubes around polylines."""
    points, indices, start = [], [], 0
    angle = np.arange(sides) * (2.0 * np.pi / sides)
    for line in lines:
        line = np.asarray(line, float)
        if line.ndim != 2 or line.shape[1] != 3 or len(line) < 2:
            raise ValueError(f"expects lines of shape (2 or more, 3), but got {line.shape}")
        along = np.gradient(line, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1.0e-30)
        side = np.cross(along[0], np.eye(3)[np.argmin(np.abs(along[0]))])
        for k, direction in enumerate(along):
            side = side - direction * (side @ direction)
            side /= max(np.linalg.norm(side), 1.0e-30)
            other = np.cross(direction, side)
            ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * other
            points.append(line[k] + radius * ring)
        ring = start + np.arange(len(line) - 1)[:, None] * sides
        a = ring + np.arange(sides)
        b = ring + (np.arange(sides) + 1) % sides
        faces = np.stack([a, b, b + sides, a, b + sides, a + sides], axis=-1)
        indices.append(faces.reshape(-1))
        start += len(line) * sides
    if not points:
        raise ValueError("expects one or more lines, but got none")
    return np.concatenate(points).astype(np.float32), np.concatenate(indices).astype(np.int32)
