"""Triangle meshes in files of other programs, by trimesh: OBJ, STL, PLY, glTF."""

from __future__ import annotations

import os
import typing

from warp.extend import checked, errors
from warp.extend.kinds import PATH

ENDINGS = (".obj", ".stl", ".ply", ".glb", ".gltf")


class MeshData(typing.NamedTuple):
    """A triangle mesh as NumPy arrays; normals, uvs and colors are None where the file has none."""

    points: typing.Any
    indices: typing.Any
    normals: typing.Any = None
    uvs: typing.Any = None
    colors: typing.Any = None


def _trimesh(path):
    ending = os.path.splitext(os.fspath(path))[1].lower()
    if ending not in ENDINGS:
        known = ", ".join(f"'{name}'" for name in ENDINGS)
        raise ValueError(f"expects a mesh's name to end in one of {known}, but got '{ending}'")
    try:
        import trimesh
    except ImportError as error:
        raise errors.absent("trimesh", f"a mesh as '{ending}'") from error
    return trimesh, ending[1:]


@checked(path=PATH)
def load_mesh(path) -> MeshData:
    """Reads the triangles of a file; parts of a scene are put where it places them.

    Args:
        path: of the file, `.obj`, `.stl`, `.ply`, `.glb` or `.gltf`.

    Raises:
        ValueError: the file has no triangles or is damaged, or the ending is another one.
        ImportError: trimesh is not installed.

    Example:
        >>> import warp as wp
        >>> data = wp.render.load_mesh("bunny.glb")  # doctest: +SKIP
        >>> points = wp.array(data.points, dtype=wp.vec3)  # doctest: +SKIP
        >>> mesh = wp.Mesh(points, wp.array(data.indices, dtype=int))  # doctest: +SKIP
    """
    import numpy

    trimesh, _ = _trimesh(path)
    with open(path, "rb"):
        # An absent file is FileNotFoundError, whatever trimesh makes of it.
        pass
    try:
        found = trimesh.load(os.fspath(path), process=False)
        if isinstance(found, trimesh.Scene):
            found = found.to_geometry()
    except Exception as error:
        raise ValueError(f"'{path}' cannot be read: {type(error).__name__}: {error}") from error
    if not len(getattr(found, "faces", ())):
        raise ValueError(f"expects triangles in '{path}', but it has none")
    visual = found.visual
    colors = uvs = None
    if visual.kind == "vertex":
        colors = numpy.asarray(visual.vertex_colors[:, :3], numpy.float32) / 255.0
    elif getattr(visual, "uv", None) is not None:
        uvs = numpy.asarray(visual.uv, numpy.float32)
    return MeshData(
        numpy.asarray(found.vertices, numpy.float32),
        numpy.asarray(found.faces, numpy.int32).reshape(-1),
        numpy.asarray(found.vertex_normals, numpy.float32),
        uvs,
        colors,
    )


@checked(path=PATH)
def save_mesh(path, points, indices, colors=None, uvs=None) -> None:
    """Writes a triangle mesh.

    Args:
        path: of the file, `.obj`, `.stl`, `.ply`, `.glb` or `.gltf`.
        points: of shape (n, 3), array of Warp or NumPy.
        indices: three for each face.
        colors: of the points, 0 to 1; STL has none.
        uvs: texture coordinates of the points.

    Raises:
        ValueError: there are no faces, an index is out of range, or the ending is another one.
        ImportError: trimesh is not installed.
    """
    trimesh, _ = _trimesh(path)
    made = make_mesh(trimesh, points, indices, colors, uvs)
    made.export(os.fspath(path))


def make_mesh(trimesh, points, indices, colors=None, uvs=None, material=None):
    """A mesh of trimesh, with points as they are."""
    import numpy

    rows = [None if a is None else _values(a) for a in (points, colors, uvs)]
    faces = _values(indices).reshape(-1)
    if faces.size == 0 or faces.size % 3 or faces.dtype.kind not in "iu":
        raise ValueError(
            f"expects three indices for each of one or more faces, but got {faces.size} values of "
            f"type '{faces.dtype}'"
        )
    if faces.min() < 0 or faces.max() >= len(rows[0]):
        raise ValueError(
            f"expects indices from 0 to {len(rows[0]) - 1}, but got {faces.min()} to {faces.max()}"
        )
    made = trimesh.Trimesh(rows[0], faces.reshape(-1, 3), process=False)
    if rows[1] is not None:
        made.visual.vertex_colors = numpy.rint(255.0 * numpy.clip(rows[1], 0.0, 1.0)).astype("u1")
    elif rows[2] is not None or material is not None:
        made.visual = trimesh.visual.TextureVisuals(uv=rows[2], material=material)
    return made


def _values(array):
    import numpy

    return array.numpy() if hasattr(array, "numpy") else numpy.asarray(array)
