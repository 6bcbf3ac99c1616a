"""Checks of geometries - flat, inverted, folded and repeated cells, by number."""

import functools
import itertools
import warnings
from dataclasses import dataclass, field, fields

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.derived import of_gradient
from warp._src.fem.geometry.shapes import DIMENSIONS, cell_of
from warp._src.fem.types import coords_type, make_free_sample

_WORDS = {
    "not_finite": "cells with NaN or infinite positions",
    "repeated_vertices": "cells that name a vertex twice",
    "flat": "cells of measure 0",
    "slivers": "cells so nearly flat that half of the digits are lost",
    "inverted": "cells of negative orientation",
    "folded": "cells that are not convex or cross themselves, whose orientation changes inside",
    "duplicates": "cells with the vertices of a cell before them",
    "crowded_sides": "sides between more than two cells",
}


def _none() -> np.ndarray:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class GeometryReport:
    """Findings of `check`: numbers of cells (of sides, for `crowded_sides`).

    Attributes:
        not_finite: cells with NaN or infinite positions.
        repeated_vertices: cells that name a vertex twice.
        flat: cells of measure 0.
        slivers: cells whose measure is below the product of their edges' lengths by more than the
            root of the unit of rounding: derivatives lose half of their digits.
        inverted: cells of negative orientation; legal, `measure` is positive.
        folded: cells whose orientation changes inside: not convex, or crossing themselves.
        duplicates: cells with the same vertices as one before them.
        crowded_sides: sides that more than two cells share.
    """

    not_finite: np.ndarray = field(default_factory=_none)
    repeated_vertices: np.ndarray = field(default_factory=_none)
    flat: np.ndarray = field(default_factory=_none)
    slivers: np.ndarray = field(default_factory=_none)
    inverted: np.ndarray = field(default_factory=_none)
    folded: np.ndarray = field(default_factory=_none)
    duplicates: np.ndarray = field(default_factory=_none)
    crowded_sides: np.ndarray = field(default_factory=_none)

    @property
    def is_fine(self) -> bool:
        """Nothing was found but negative orientations."""
        return not any(len(getattr(self, f.name)) for f in fields(self) if f.name != "inverted")

    def __str__(self) -> str:
        lines = []
        for f in fields(self):
            numbers = getattr(self, f.name)
            if len(numbers):
                shown = ", ".join(map(str, numbers[:8])) + (", ..." if len(numbers) > 8 else "")
                lines.append(f"{len(numbers)} {_WORDS[f.name]}: {shown}")
        return "\n".join(lines) or "no findings"


def _sample_points(cell: str) -> np.ndarray:
    """Coordinates where orientation is tested: corners, mid-points of edges and faces, center."""
    k = DIMENSIONS[cell]
    if cell in ("triangle", "tet"):
        corners = np.vstack((np.zeros(k), np.eye(k)))
        pairs = [(a + b) / 2 for a, b in itertools.combinations(corners, 2)]
        points = np.vstack((corners, pairs, [corners.mean(axis=0)]))
    else:
        points = np.array(list(itertools.product((0.0, 0.5, 1.0), repeat=k)))
    return cell_of(cell).coords(points)


# Products of differences are exact to a few units in the last place.
_FLAT = {wp.float32: 2.0**-19, wp.float64: 2.0**-46}
_SLIVER = {wp.float32: 2.0**-11.5, wp.float64: 2.0**-26}
# Kinds of cells that a warning names.
_WARNED = ("not_finite", "flat", "folded", "slivers")


@functools.cache
def _orientation_kernel(record):
    """The kernel that writes the least and largest orientation of each cell, from -1 to 1; None for
    curves."""
    functions, real, cell = record.functions, record.scalar, record.cell
    k, d = DIMENSIONS[cell], record.dimension
    points = _sample_points(cell)
    n, Coords, CellArg = len(points), coords_type(real), functions.CellArg
    gradient, is_solid = functions.cell_deformation_gradient, k == d
    if k == 1 or (not is_solid and of_gradient(k, d)[1] is None):
        return None

    @wp.func
    def size_of(arg: CellArg, cell: int, q: int):
        """Gradient's orientation relative to the product of its columns' lengths."""
        c = Coords(real(points[q, 0]), real(points[q, 1]), real(points[q, 2]))
        F = gradient(arg, make_free_sample(cell, c))
        Ft = wp.transpose(F)
        product = real(1.0)
        for i in range(k):
            product *= wp.length(Ft[i])
        if product == real(0.0):
            return product
        if wp.static(is_solid):
            return wp.determinant(F) / product
        else:
            return wp.length(wp.cross(Ft[0], Ft[1])) / product

    @wp.kernel(enable_backward=False)
    def orient(
        arg: CellArg,
        low: wp.array(dtype=wp.float64),
        high: wp.array(dtype=wp.float64),
    ):
        i = wp.tid()
        least = size_of(arg, i, 0)
        most = least
        for q in range(1, n):
            size = size_of(arg, i, q)
            # A NaN stays.
            least = wp.where(size >= least, least, size)
            most = wp.where(size <= most, most, size)
        low[i], high[i] = wp.float64(least), wp.float64(most)

    return orient


# Edges by vertices, along each axis of a reference cell: a column of the gradient is a convex
# combination of an axis's edges.
_EDGES = {
    "triangle": ([(0, 1)], [(0, 2)]),
    "square": ([(0, 1), (3, 2)], [(0, 3), (1, 2)]),
    "tet": ([(0, 1)], [(0, 2)], [(0, 3)]),
    "cube": (
        [(0, 1), (3, 2), (4, 5), (7, 6)],
        [(0, 3), (1, 2), (4, 7), (5, 6)],
        [(0, 4), (1, 5), (2, 6), (3, 7)],
    ),
}
# Cells of a mesh that NumPy bounds in less time than the kernel takes to compile.
_FEW_CELLS = 4096


def _are_surely_fine(geometry) -> bool:
    """True if bounds show that no cell of a small solid mesh on the CPU is bad.

    The determinant is linear in each column, so it lies between determinants of edges.
    """
    record, table = geometry.record, getattr(geometry, "cell_vertices", None)
    if table is None or geometry.base is not geometry or len(table) > _FEW_CELLS:
        return False
    if record.dimension != DIMENSIONS[record.cell]:
        return False
    if len(table) == 0:
        return True
    corners = geometry.positions.numpy()[table.numpy()].astype(np.float64)
    edges = [
        np.stack([corners[:, b] - corners[:, a] for a, b in axis], axis=1)
        for axis in _EDGES[record.cell]
    ]
    lengths = [np.linalg.norm(axis, axis=2) for axis in edges]
    longest = np.prod([one.max(axis=1) for one in lengths], axis=0)
    sizes = np.concatenate(lengths, axis=1)
    if len(edges) == 2:
        (x, y), (u, v) = (np.moveaxis(axis, 2, 0) for axis in edges)
        bounds = x[:, :, None] * v[:, None] - y[:, :, None] * u[:, None]
    else:
        normals = np.cross(edges[0][:, :, None], edges[1][:, None]).reshape(len(corners), -1, 3)
        bounds = normals @ edges[2].transpose(0, 2, 1)
    bounds = bounds.reshape(len(corners), -1)
    least = np.maximum(bounds.min(axis=1), -bounds.max(axis=1))
    # The kernel rounds where edges differ much in length; NaN is not fine.
    is_even = sizes.min(axis=1) * 1024.0 > sizes.max(axis=1)
    return bool((is_even & (least > 2.0 * _SLIVER[record.scalar] * longest)).all())


def warn_of_bad_cells(geometry, device) -> None:
    """Warns of cells that forms cannot be integrated on, once for a mesh."""
    kept = vars(geometry)
    if "_is_checked" in kept or device.is_capturing:
        return
    kept["_is_checked"] = True
    if device.is_cpu and _are_surely_fine(geometry):
        return
    found = _orientations(geometry, device)
    found = {kind: found[kind] for kind in _WARNED if len(found.get(kind, ()))}
    if found:
        shown = [f"{_WORDS[k]} ({len(n)}, the first is cell {n[0]})" for k, n in found.items()]
        message = f"{geometry.name} has {'; '.join(shown)}; `geometry.check()` lists all"
        warnings.warn(message, stacklevel=3)


def _orientations(geometry, device) -> dict:
    """Cells that are not finite, flat, folded, slivers or inverted."""
    kernel, n = _orientation_kernel(geometry.record), geometry.cell_count()
    if kernel is None or not n:
        return {}
    with extend.unrecorded():
        low, high = (wp.zeros(n, dtype=wp.float64, device=device) for _ in range(2))
        wp.launch(kernel, n, [geometry.cell_arg_value(device)], [low, high], device=device)
        low, high = low.numpy(), high.numpy()
    tolerance, sliver = _FLAT[geometry.scalar_type], _SLIVER[geometry.scalar_type]
    is_nan = ~np.isfinite(low) | ~np.isfinite(high)
    smallest, largest = np.minimum(np.abs(low), np.abs(high)), np.maximum(np.abs(low), np.abs(high))
    flat = ~is_nan & (largest <= tolerance)
    folded = ~is_nan & ~flat & (low <= tolerance) & (high >= -tolerance)
    kinds = {"not_finite": is_nan, "flat": flat, "folded": folded}
    kinds["slivers"] = ~is_nan & ~flat & ~folded & (smallest <= sliver)
    kinds["inverted"] = ~is_nan & ~flat & (high < -tolerance)
    return {kind: np.flatnonzero(cells) for kind, cells in kinds.items()}


def _of_tables(geometry) -> dict:
    """Findings of a mesh's tables."""
    table = getattr(geometry, "cell_vertices", None)
    if table is None or geometry.base is not geometry:
        return {}
    cells = np.sort(table.numpy(), axis=1)
    repeated = (cells[:, 1:] == cells[:, :-1]).any(axis=1)
    _, first = np.unique(cells, axis=0, return_index=True)
    is_first = np.zeros(len(cells), bool)
    is_first[first] = True
    found = {"repeated_vertices": np.flatnonzero(repeated)}
    found["duplicates"] = np.flatnonzero(~is_first)
    of_sides = geometry.entities().sides
    counts = np.bincount(of_sides.of_cells.numpy().ravel(), minlength=of_sides.count)
    found["crowded_sides"] = np.flatnonzero(counts > 2)
    found["not_finite"] = np.flatnonzero(
        ~np.isfinite(geometry.positions.numpy()[table.numpy()]).all(axis=(1, 2))
    )
    return found


def check_geometry(geometry, device=None) -> GeometryReport:
    """Looks for cells that forms cannot be integrated on; see `GeometryReport`."""
    found = _orientations(geometry, wp.get_device(device))
    for kind, cells in _of_tables(geometry).items():
        found[kind] = np.union1d(found.get(kind, _none()), cells)
    return GeometryReport(**found)
