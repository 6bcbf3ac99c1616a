"""Arrays, kernels, meshes and volumes as notebooks show them: HTML without a script."""

from __future__ import annotations

import html

_MOST_FACES = 1500
_SIZE = 180


def _page(title, rows, extra="") -> str:
    cells = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(str(value))}</td></tr>"
        for name, value in rows
    )
    return f"<div><strong>{html.escape(title)}</strong>{extra}<table>{cells}</table></div>"


def array_html(array, dtype) -> str:
    """Shape, type, device and a few elements, of which no more are copied."""
    rows = [("shape", array.shape), ("dtype", dtype), ("device", array.device)]
    if array.requires_grad:
        rows.append(("gradient", "yes"))
    first = array
    for _ in range(array.ndim - 1):
        first = first[0] if first.shape[0] else first
    if array.size and first.ndim == 1:
        count = min(6, first.shape[0])
        text = ", ".join(map(str, first[:count].numpy().tolist()))
        rows.append(("begins", text + (", ..." if array.size > count else "")))
    return _page("wp.array", rows)


def kernel_html(kernel) -> str:
    """Signature, and the schedule of the launches so far."""
    import inspect

    rows = [("signature", f"{kernel.key}{inspect.signature(kernel.func)}")]
    rows.append(("module", kernel.module.name))
    if getattr(kernel, "is_generic", False):
        return _page(f"kernel '{kernel.key}'", rows)
    text = "\n".join(map(str, kernel.schedule()))
    return _page(f"kernel '{kernel.key}'", rows) + f"<pre>{html.escape(text)}</pre>"


def mesh_html(mesh) -> str:
    """Counts and a picture from one side."""
    points = mesh.points.numpy()
    faces = mesh.indices.numpy().reshape(-1, 3)
    rows = [("points", len(points)), ("faces", len(faces)), ("device", mesh.device)]
    return _page("wp.Mesh", rows, _drawn(points, faces))


def volume_html(volume) -> str:
    """The grid's name, type, voxels and size."""
    info = volume.get_grid_info()
    kind = "numbers of voxels" if volume.is_index else volume.dtype.__name__
    rows = [("grid", info.name or "-"), ("values", kind), ("voxels", volume.get_voxel_count())]
    rows += [("voxel size", volume.get_voxel_size()), ("device", volume.device)]
    return _page("wp.Volume", rows)


def _drawn(points, faces) -> str:
    """Some of the faces as SVG, from back to front, bright where they face the light."""
    import numpy

    if not len(faces) or not numpy.isfinite(points).all():
        return ""
    turn = numpy.array([[0.866, 0.0, -0.5], [-0.25, 0.866, -0.433], [0.433, 0.5, 0.75]])
    seen = points @ turn.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    scale = (_SIZE - 8) / max(float((high - low)[:2].max()), 1e-30)
    flat = (seen[:, :2] - low[:2]) * scale + 4.0
    flat[:, 1] = _SIZE - flat[:, 1]
    if len(faces) > _MOST_FACES:
        faces = faces[numpy.linspace(0, len(faces) - 1, _MOST_FACES).astype(int)]
    faces = faces[numpy.argsort(seen[faces, 2].mean(axis=1))]
    a, b, c = (seen[faces[:, k]] for k in range(3))
    normal = numpy.cross(b - a, c - a)
    length = numpy.maximum(numpy.linalg.norm(normal, axis=1), 1e-30)
    bright = (60 + 150 * numpy.abs(normal @ [0.3, 0.5, 0.81]) / length).astype(int)
    parts = [
        f"<path d='M{x0:.0f} {y0:.0f}L{x1:.0f} {y1:.0f}L{x2:.0f} {y2:.0f}Z' "
        f"fill='rgb({g},{g},{min(255, g + 20)})'/>"
        for ((x0, y0), (x1, y1), (x2, y2)), g in zip(flat[faces].tolist(), bright.tolist())
    ]
    return f"<br><svg width='{_SIZE}' height='{_SIZE}'>{''.join(parts)}</svg>"
