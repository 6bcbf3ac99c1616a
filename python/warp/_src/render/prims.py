"""Common parts of shapes of a USD stage: solids, colours, and arrays for attributes."""

from __future__ import annotations

import numpy

_AXES = ("X", "Y", "Z")


def host(values):
    """An array on the host, or what stands for one."""
    return values.numpy() if hasattr(values, "numpy") else values


def positions(values, name):
    """Points as float32 of shape (n, 3).

    Raises:
        ValueError: they have another shape.
    """
    found = numpy.asarray(host(values), numpy.float32)
    if not found.size:
        return found.reshape(0, 3)
    if found.ndim != 2 or found.shape[1] != 3:
        raise ValueError(f"expects points of shape (n, 3) for '{name}', but got {found.shape}")
    return found


def indices_of(values):
    """Indices as one row of int32."""
    return numpy.asarray(host(values)).astype(numpy.int32).reshape(-1)


class Prims:
    """Helpers of the methods that draw."""

    def _solid(self, kind, name, parent_body, is_template):
        """The path and the prim of a shape."""
        path = self._path(name, parent_body, is_template)
        return path, self._drawn_as(path, getattr(self.usd.UsdGeom, kind))[0]

    def _round(
        self,
        kind,
        name,
        pos,
        rot,
        radius,
        half_height,
        parent_body=None,
        is_template=False,
        up_axis=1,
        color=None,
        visible=True,
    ):
        path, made = self._solid(kind, name, parent_body, is_template)
        self._measures(made, radius, 2.0 * half_height, up_axis)
        return self._done(path, made, pos, rot, color, visible)

    def _measures(self, made, radius, height, up_axis) -> None:
        if up_axis not in (0, 1, 2):
            raise ValueError(f"expects 0, 1 or 2 as up_axis, but got {up_axis!r}")
        made.CreateRadiusAttr().Set(float(radius), self.time)
        made.CreateHeightAttr().Set(float(height), self.time)
        made.CreateAxisAttr().Set(_AXES[up_axis])

    def _done(self, path, made, pos, rot, color, visible, scale=(1.0, 1.0, 1.0)):
        self._place(path, pos, rot, scale, visible)
        self._color(made, color)
        return path

    def _quad(self, name, corners, pos, rot, color, parent_body, is_template, visible):
        """A rectangle of four corners."""
        path = self._path(name, parent_body, is_template)
        mesh, _ = self._drawn_as(path, self.usd.UsdGeom.Mesh)
        mesh.CreateSubdivisionSchemeAttr().Set("none")
        mesh.CreatePointsAttr().Set(self._vectors(positions(corners, name)))
        mesh.CreateFaceVertexCountsAttr().Set(self._ints([4]))
        mesh.CreateFaceVertexIndicesAttr().Set(self._ints([0, 1, 2, 3]))
        return self._done(path, mesh, pos, rot, color, visible)

    def _curves(self, name, points, lines, length, color, radius, visible):
        """Lines of `length` points each."""
        path = self._path(name)
        curves, is_new = self._drawn_as(path, self.usd.UsdGeom.BasisCurves)
        if is_new:
            curves.CreateTypeAttr().Set("linear")
            curves.SetWidthsInterpolation("constant")
        used = points[: lines * length]
        curves.CreatePointsAttr().Set(self._vectors(used), self.time)
        curves.CreateCurveVertexCountsAttr().Set(self._ints([length] * lines), self.time)
        widths = self.usd.Vt.FloatArray([2.0 * float(radius)])
        curves.CreateWidthsAttr().Set(widths, self.time)
        self._color(curves, color)
        self._place(path, visible=visible)
        return path

    def _vectors(self, values):
        rows = numpy.ascontiguousarray(values, numpy.float32)
        return self.usd.Vt.Vec3fArray.FromNumpy(rows) if len(rows) else self.usd.Vt.Vec3fArray()

    def _ints(self, values):
        numbers = numpy.ascontiguousarray(values, numpy.int32)
        return self.usd.Vt.IntArray.FromNumpy(numbers) if numbers.size else self.usd.Vt.IntArray()

    def _colors(self, made, colors, count, name) -> None:
        """One colour for all points, or one for each."""
        if colors is None:
            return
        values = numpy.asarray(host(colors), numpy.float32).reshape(-1, 3)
        if len(values) not in (1, count):
            raise ValueError(f"expects one colour or {count} for '{name}', but got {len(values)}")
        kind = "constant" if len(values) == 1 else "vertex"
        self.usd.UsdGeom.PrimvarsAPI(made).CreatePrimvar(
            "displayColor", self.usd.Sdf.ValueTypeNames.Color3fArray, kind
        ).Set(self._vectors(values), self.time)
