"""Pages for a browser: the meshes and spheres of a scene, frame by frame, in one file.

Positions are kept as 16-bit steps across the box that holds a part in all frames.
"""

import base64
import json
import pathlib

import numpy as np

from warp._src.render.tracing.decimation import clustered
from warp._src.render.tracing.page_script import PAGE
from warp.extend import notice

_STEPS = 65535


class Frame:
    """Points and placements of a scene at one time."""

    def __init__(self, scene):
        self.points = [mesh.points.numpy().copy() for mesh in scene.meshes]
        self.transforms = [copies.transforms for copies in scene.instances]
        self.spheres = [spheres.rows.copy() for spheres in scene.spheres]


class Blob:
    """Arrays one after the other, as a page reads them."""

    def __init__(self):
        self.parts, self.size, self.known = [], 0, {}

    def add(self, array):
        """The place of an array, each with the same bytes once: [offset, length, type]."""
        array = np.ascontiguousarray(array)
        data = array.tobytes()
        key = (array.dtype.char, data)
        if key not in self.known:
            self.known[key] = [self.size, array.size, array.dtype.name]
            padding = -len(data) % 4
            self.parts.append(data + b"\0" * padding)
            self.size += len(data) + padding
        return self.known[key]

    def quantized(self, frames):
        """Positions of all frames: the box that holds them, and steps within it."""
        low = np.min([rows.min(axis=0) for rows in frames], axis=0)
        span = np.max([rows.max(axis=0) for rows in frames], axis=0) - low
        scale = np.where(span > 0.0, _STEPS / np.maximum(span, 1.0e-30), 0.0)
        steps = [np.rint((rows - low) * scale).astype(np.uint16) for rows in frames]
        return {
            "low": low.tolist(),
            "step": (span / _STEPS).tolist(),
            "frames": [self.add(rows) for rows in steps],
        }


def save_page(scene, path, title, fps, max_triangles, decimate) -> None:
    """Writes the page of a scene; see `Scene.save_html`."""
    if not fps > 0.0:
        raise ValueError(f"expects a positive number of frames a second, but got {fps}")
    frames = scene.frames or [Frame(scene)]
    for frame in frames:
        if len(frame.points) != len(scene.meshes) or len(frame.spheres) != len(scene.spheres):
            raise ValueError("expects no parts added after the first kept frame")
    if scene.media or scene.level_sets:
        notice("save_html shows meshes and spheres; volumes and level sets are left out")
    blob = Blob()
    share = kept_share(scene, max_triangles, decimate, "save_html")
    data = {
        "up": scene.up.tolist(),
        "fps": float(fps),
        "count": len(frames),
        "view": {**scene.view, "aspect": scene.width / scene.height},
        "sun": (scene.sun[0] if scene.sun else scene.up + [0.4, 0.2, 0.5]).tolist(),
        "meshes": _meshes(scene, frames, blob, share),
        "spheres": [_spheres(scene, frames, number, blob) for number in range(len(scene.spheres))],
    }
    text = PAGE.replace("@TITLE@", _escaped(title))
    text = text.replace("@DATA@", json.dumps(data).replace("</", "<\\/"))
    text = text.replace("@BLOB@", base64.b64encode(b"".join(blob.parts)).decode())
    pathlib.Path(path).write_text(text, encoding="utf-8")


def _escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;")


def kept_share(scene, most, decimate, where):
    """The share of its triangles that each mesh keeps, of which a browser gets at most some.

    Raises:
        ValueError: there are more, and no coarser copy was asked for.
    """
    copies = {}
    for placed in scene.instances:
        copies[id(placed.mesh)] = copies.get(id(placed.mesh), 0) + len(placed.transforms)
    total = sum(len(m.indices) // 3 * copies.get(id(m), 0) for m in scene.meshes)
    if total <= most:
        return 1.0
    if not decimate:
        raise ValueError(
            f"the scene has {total:,} triangles and a page shows up to {most:,}: pass "
            f"decimate=True for a coarser copy, or max_triangles={total}"
        )
    notice(f"{where} keeps about {most:,} of {total:,} triangles")
    return most / total


def _material(scene, number):
    row = scene.materials[number][0]
    color = np.minimum(row["color"] + row["emission"], 1.0)
    glass = float(row["transmission"])
    return {
        "color": color.tolist(),
        "shine": float(1.0 - row["roughness"]),
        "metal": float(row["metallic"]),
        "alpha": 1.0 - 0.7 * glass,
        "glow": float(row["emission"].max() > 0.0),
        "checker": float(row["checker"]),
    }


def _meshes(scene, frames, blob, share):
    out = []
    for number, mesh in enumerate(scene.meshes):
        indices = mesh.indices.numpy().reshape(-1, 3)
        kept = np.arange(len(mesh.points))
        if share < 1.0:
            kept, indices = clustered(frames[0].points[number], indices, share * len(indices))
        colors = None
        if mesh.colors is not None:
            colors = blob.add(_bytes(mesh.colors.numpy()[kept]))
        part = {
            "points": blob.quantized([frame.points[number][kept] for frame in frames]),
            "indices": blob.add(indices.astype(np.uint32)),
            "smooth": mesh.smooth,
            "colors": colors,
            "copies": [],
        }
        for place, copies in enumerate(scene.instances):
            if copies.mesh is mesh:
                part["copies"].append(_copies(scene, frames, place, copies, blob))
        out.append(part)
    return out


def _copies(scene, frames, place, copies, blob):
    tints = np.ones((len(copies.transforms), 3)) if copies.tints is None else copies.tints
    # WebGL takes matrices by columns.
    rows = [frame.transforms[place].swapaxes(1, 2).astype(np.float32) for frame in frames]
    return {
        "material": _material(scene, copies.material),
        "tints": blob.add(_bytes(tints)),
        "transforms": [blob.add(matrices) for matrices in rows],
    }


def _spheres(scene, frames, number, blob):
    spheres = scene.spheres[number]
    rows = [frame.spheres[number] for frame in frames]
    colors = np.ones((len(spheres.rows), 3)) if spheres.colors is None else spheres.colors
    return {
        "material": _material(scene, spheres.material),
        "centers": blob.quantized([row[:, :3] for row in rows]),
        "radii": [blob.add(row[:, 3]) for row in rows],
        "colors": blob.add(_bytes(colors)),
    }


def _bytes(colors):
    return np.rint(255.0 * np.clip(colors, 0.0, 1.0)).astype(np.uint8)
