"""Parts of a scene: meshes, their instances, spheres, media and level sets."""

import numpy as np

import warp as wp
from warp._src.render.tracing.records import Instance, LevelSet, Medium


def vectors(values, name, length=3, device=None):
    """Vectors as a float32 array of Warp on a device; refuses what has another shape."""
    dtype = wp.types.vector(length=length, dtype=wp.float32)
    if isinstance(values, wp.array):
        if values.device == device and values.dtype == dtype and values.is_contiguous:
            return values.flatten()
        values = values.numpy()
    rows = np.asarray(values, np.float32)
    if rows.ndim != 2 or rows.shape[1] != length:
        raise ValueError(f"expects {name} of shape (n, {length}), but got {rows.shape}")
    return wp.array(rows, dtype=dtype, device=device)


def check_finite(values, name):
    """Refuses positions that are NaN or infinite."""
    rows = values.numpy()
    bad = ~np.isfinite(rows).all(axis=tuple(range(1, rows.ndim)))
    if bad.any():
        raise ValueError(
            f"expects finite {name}, but got {rows[bad][0]} as number {int(np.argmax(bad))}"
        )
    return rows


def matrices(transforms):
    """Affine maps as matrices of shape (n, 4, 4)."""
    if transforms is None:
        return np.eye(4)[None]
    if hasattr(transforms, "numpy"):
        transforms = transforms.numpy()
    rows = np.asarray(transforms, np.float64)
    if rows.shape[-1] == 7:
        rows = rows.reshape(-1, 7)
        out = np.tile(np.eye(4), (len(rows), 1, 1))
        x, y, z, w = (rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)).T
        out[:, 0, :3] = np.stack(
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1
        )
        out[:, 1, :3] = np.stack(
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1
        )
        out[:, 2, :3] = np.stack(
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1
        )
        out[:, :3, 3] = rows[:, :3]
        return out
    if rows.shape[-2:] != (4, 4):
        raise ValueError(f"expects transforms of shape (n, 7) or (n, 4, 4), but got {rows.shape}")
    return rows.reshape(-1, 4, 4)


@wp.kernel(enable_backward=False)
def sum_normals(
    points: wp.array(dtype=wp.vec3), indices: wp.array(dtype=int), normals: wp.array(dtype=wp.vec3)
):
    face = wp.tid()
    a = indices[3 * face]
    b = indices[3 * face + 1]
    c = indices[3 * face + 2]
    # Faces count by their area.
    n = wp.cross(points[b] - points[a], points[c] - points[a])
    wp.atomic_add(normals, a, n)
    wp.atomic_add(normals, b, n)
    wp.atomic_add(normals, c, n)


@wp.kernel(enable_backward=False)
def bound_spheres(
    spheres: wp.array(dtype=wp.vec4), low: wp.array(dtype=wp.vec3), high: wp.array(dtype=wp.vec3)
):
    i = wp.tid()
    s = spheres[i]
    center = wp.vec3(s[0], s[1], s[2])
    low[i] = center - wp.vec3(s[3])
    high[i] = center + wp.vec3(s[3])


class SceneMesh:
    """A triangle mesh of a scene; `update` moves its points."""

    def __init__(self, scene, points, indices, smooth, uvs, colors):
        device = scene.device
        self.scene, self.smooth = scene, smooth
        self.points = wp.clone(vectors(points, "points", device=device))
        rows = indices.numpy() if hasattr(indices, "numpy") else np.asarray(indices)
        rows = rows.reshape(-1)
        if rows.size == 0 or rows.size % 3 or rows.dtype.kind not in "iu":
            raise ValueError(
                f"expects three indices for each of one or more faces, but got {rows.size} "
                f"values of type '{rows.dtype}'"
            )
        if rows.min() < 0 or rows.max() >= len(self.points):
            raise ValueError(
                f"expects indices from 0 to {len(self.points) - 1}, but got {rows.min()} to "
                f"{rows.max()}"
            )
        self.indices = wp.array(rows.astype(np.int32), dtype=int, device=device)
        self.uvs = None if uvs is None else vectors(uvs, "uvs", 2, device)
        self.colors = None if colors is None else vectors(colors, "colors", 3, device)
        for name, values in (("uvs", self.uvs), ("colors", self.colors)):
            if values is not None and len(values) != len(self.points):
                raise ValueError(
                    f"expects {name} for {len(self.points)} points, but got {len(values)}"
                )
        self._bound()
        self.mesh = wp.Mesh(self.points, self.indices)

    def _bound(self):
        rows = check_finite(self.points, "points")
        self.low, self.high = rows.min(axis=0), rows.max(axis=0)

    def normals(self):
        """Normals of the points, means of the faces' by area."""
        out = wp.zeros(len(self.points), dtype=wp.vec3, device=self.scene.device)
        inputs = [self.points, self.indices]
        faces = len(self.indices) // 3
        wp.launch(sum_normals, faces, inputs, [out], device=self.scene.device)
        return out

    def update(self, points) -> None:
        """Moves the points; the faces stay."""
        points = vectors(points, "points", device=self.scene.device)
        if len(points) != len(self.points):
            raise ValueError(f"expects {len(self.points)} points, but got {len(points)}")
        wp.copy(self.points, points)
        self._bound()
        self.mesh.refit()
        self.scene._changed()


class Instances:
    """Copies of a mesh, each placed by an affine map; `update` moves them."""

    def __init__(self, scene, mesh, transforms, tints, material):
        self.scene, self.mesh, self.material = scene, mesh, material
        self._place(transforms)
        self.tints = None if tints is None else np.asarray(tints, np.float32)
        if self.tints is not None and self.tints.shape != (len(self.transforms), 3):
            raise ValueError(
                f"expects tints of shape ({len(self.transforms)}, 3), but got {self.tints.shape}"
            )

    def _place(self, transforms):
        self.transforms = matrices(transforms)
        volume = np.abs(np.linalg.det(self.transforms[:, :3, :3]))
        if not (volume > 0.0).all():
            number = int(np.argmin(volume > 0.0))
            raise ValueError(
                f"expects transforms that have an inverse, but number {number} has none"
            )

    def update(self, transforms) -> None:
        """Places the copies anew."""
        count = len(self.transforms)
        self._place(transforms)
        if len(self.transforms) != count:
            raise ValueError(f"expects {count} transforms, but got {len(self.transforms)}")
        self.scene._changed()

    def rows(self, shape):
        """Records for kernels and the boxes around the copies."""
        maps = self.transforms
        rows = np.zeros(len(maps), Instance.numpy_dtype())
        rows["linear"], rows["inverse"] = maps[:, :3, :3], np.linalg.inv(maps[:, :3, :3])
        rows["origin"] = maps[:, :3, 3]
        rows["tint"] = 1.0 if self.tints is None else self.tints
        rows["shape"], rows["material"] = shape, self.material
        corners = np.stack([self.mesh.low, self.mesh.high])
        boxes = np.stack(np.meshgrid(*corners.T, indexing="ij"), -1).reshape(-1, 3)
        world = np.einsum("nij,kj->nki", maps[:, :3, :3], boxes) + maps[:, None, :3, 3]
        return rows, world.min(axis=1), world.max(axis=1)


class Spheres:
    """Spheres of a scene; `update` moves them and may change their radii and colours."""

    def __init__(self, scene, centers, radii, colors, material):
        self.scene, self.material = scene, material
        self.colors = None
        self._set(centers, radii, colors)

    def _set(self, centers, radii, colors):
        rows = check_finite(vectors(centers, "centers", device=self.scene.device), "centers")
        if len(rows) == 0:
            raise ValueError("expects one or more spheres, but got none")
        radii = radii.numpy() if hasattr(radii, "numpy") else np.asarray(radii, np.float32)
        if radii.ndim > 1 or (radii.ndim == 1 and radii.shape != (len(rows),)):
            raise ValueError(f"expects one radius or {len(rows)}, but got shape {radii.shape}")
        if not (np.isfinite(radii).all() and (radii > 0.0).all()):
            raise ValueError(f"expects positive radii, but got {float(np.min(radii))}")
        self.rows = np.concatenate(
            [rows, np.broadcast_to(radii, len(rows))[:, None]], axis=1
        ).astype(np.float32)
        if colors is not None:
            colors = vectors(colors, "colors", device=self.scene.device).numpy()
            if len(colors) != len(rows):
                raise ValueError(f"expects {len(rows)} colors, but got {len(colors)}")
            self.colors = colors
        elif self.colors is not None and len(self.colors) != len(rows):
            raise ValueError(f"expects colors of {len(rows)} spheres, but got none")

    def update(self, centers, radii=None, colors=None) -> None:
        """Places the spheres anew; their number may change with all three given."""
        if radii is None:
            radii = self.rows[:, 3]
        self._set(centers, radii, colors)
        self.scene._changed()


def medium_row(volume, low, high, albedo, emission, scale, most, asymmetry):
    """The record of a medium."""
    row = np.zeros(1, Medium.numpy_dtype())
    row["volume"], row["low"], row["high"] = volume.id, low, high
    row["albedo"], row["emission"] = albedo, emission
    row["scale"], row["majorant"], row["asymmetry"] = scale, scale * most, asymmetry
    return row


def level_set_row(volume, low, high, tint, reach, material):
    """The record of a level set."""
    row = np.zeros(1, LevelSet.numpy_dtype())
    row["volume"], row["low"], row["high"] = volume.id, low, high
    row["tint"], row["reach"], row["material"] = tint, reach, material
    return row
