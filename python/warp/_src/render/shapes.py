"""Shapes of a USD stage: solids, meshes, lines and points, as prims of UsdGeom."""

from __future__ import annotations

import numpy

from warp._src.render.prims import Prims, host, indices_of, positions

_AXES = ("X", "Y", "Z")


class Shapes(Prims):
    """Methods of `UsdRenderer` that draw."""

    def render_sphere(
        self, name, pos, rot, radius, parent_body=None, is_template=False, color=None, visible=True
    ):
        """Draws a sphere."""
        path, made = self._solid("Sphere", name, parent_body, is_template)
        made.GetRadiusAttr().Set(float(radius), self.time)
        return self._done(path, made, pos, rot, color, visible)

    def render_box(
        self, name, pos, rot, extents, parent_body=None, is_template=False, color=None, visible=True
    ):
        """Draws a box; `extents` are half its edges."""
        path, made = self._solid("Cube", name, parent_body, is_template)
        return self._done(path, made, pos, rot, color, visible, extents)

    def render_capsule(self, name, pos, rot, radius, half_height, *args, **kwargs):
        """Draws a capsule; `half_height` is half the length between the centres of its ends.

        Further arguments: parent_body, is_template, up_axis (0 to 2, by default 1), color, visible.
        """
        return self._round("Capsule", name, pos, rot, radius, half_height, *args, **kwargs)

    def render_cylinder(self, name, pos, rot, radius, half_height, *args, **kwargs):
        """Draws a cylinder; further arguments as for a capsule."""
        return self._round("Cylinder", name, pos, rot, radius, half_height, *args, **kwargs)

    def render_cone(self, name, pos, rot, radius, half_height, *args, **kwargs):
        """Draws a cone with its tip up; further arguments as for a capsule."""
        return self._round("Cone", name, pos, rot, radius, half_height, *args, **kwargs)

    def render_arrow(
        self,
        name,
        pos,
        rot,
        base_radius,
        base_height,
        cap_radius=None,
        cap_height=None,
        parent_body=None,
        is_template=False,
        up_axis=1,
        color=None,
        visible=True,
    ):
        """Draws an arrow from `pos` along an axis: a cylinder and a cone on it."""
        cap_radius = 1.8 * base_radius if cap_radius is None else cap_radius
        cap_height = 1.8 * base_radius if cap_height is None else cap_height
        path = self._path(name, parent_body, is_template)
        self._drawn_as(path, self.usd.UsdGeom.Xform)
        self._place(path, pos, rot, (1.0, 1.0, 1.0), visible)
        parts = (
            ("Cylinder", "base", base_radius, base_height, 0.5 * base_height),
            ("Cone", "cap", cap_radius, cap_height, base_height + 0.5 * cap_height),
        )
        for kind, part, radius, height, middle in parts:
            made, _ = self._drawn_as(f"{path}/{part}", getattr(self.usd.UsdGeom, kind))
            self._measures(made, radius, height, up_axis)
            center = [middle if axis == up_axis else 0.0 for axis in range(3)]
            self._done(f"{path}/{part}", made, center, None, color, True)
        return path

    def render_plane(
        self,
        name,
        pos,
        rot,
        width,
        length,
        color=(1.0, 1.0, 1.0),
        color2=None,
        parent_body=None,
        is_template=False,
        u_scaling=1.0,
        v_scaling=1.0,
        visible=True,
    ):
        """Draws a rectangle across the Y axis; an extent of 0 stands for a large one.

        `color2`, of a pattern of squares, and its scales are accepted and change nothing.
        """
        half = [0.5 * float(extent) if extent > 0 else 500.0 for extent in (width, length)]
        corners = [(x * half[0], 0.0, z * half[1]) for x, z in ((-1, -1), (-1, 1), (1, 1), (1, -1))]
        return self._quad(name, corners, pos, rot, color, parent_body, is_template, visible)

    def render_ground(self, size=100.0, plane=None):
        """Draws a square of half extent `size` across the up axis, or across a plane.

        Args:
            plane: (a, b, c, d) of a x + b y + c z + d = 0, or None.

        Raises:
            ValueError: the plane has no normal.
        """
        up = [float(axis == self.up_axis) for axis in _AXES]
        a, b, c, d = [*up, 0.0] if plane is None else map(float, plane)
        normal = numpy.array([a, b, c])
        length = numpy.linalg.norm(normal)
        if not length > 0.0:
            raise ValueError(f"expects a plane with a normal, but got {plane!r}")
        normal /= length
        # The axis that is furthest from the normal spans the plane with the normal's product.
        side = numpy.cross(normal, numpy.eye(3)[numpy.argmin(abs(normal))])
        side *= float(size) / numpy.linalg.norm(side)
        other = numpy.cross(normal, side)
        middle = -d / length * normal
        pairs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        corners = [middle + s * side + t * other for s, t in pairs]
        return self._quad("ground", corners, None, None, (0.4, 0.4, 0.4), None, False, True)

    def render_ref(self, name, path, pos, rot, scale, color=None):
        """Draws what another USD file holds."""
        own = self._path(name)
        if own not in self._drawn:
            self._posed(own).GetPrim().GetReferences().AddReference(str(path))
        self._place(own, pos, rot, scale)
        return own

    def render_mesh(
        self,
        name,
        points,
        indices,
        colors=None,
        pos=(0.0, 0.0, 0.0),
        rot=(0.0, 0.0, 0.0, 1.0),
        scale=(1.0, 1.0, 1.0),
        update_topology=False,
        parent_body=None,
        is_template=False,
        smooth_shading=True,
        visible=True,
    ):
        """Draws a mesh of triangles.

        Args:
            points: positions, of shape (n, 3).
            indices: three for each triangle.
            colors: one for the mesh, or one for each point; None leaves them.
            update_topology: the indices change from frame to frame; else those of the first are
                kept.

        Raises:
            ValueError: points are no positions, or the indices no triples of them.
        """
        corners = indices_of(indices)
        values = positions(points, name)
        _check_triangles(corners, len(values), name)
        path = self._path(name, parent_body, is_template)
        mesh, is_new = self._drawn_as(path, self.usd.UsdGeom.Mesh)
        if is_new:
            mesh.CreateSubdivisionSchemeAttr().Set("none")
            if not smooth_shading:
                mesh.SetNormalsInterpolation("uniform")
        if is_new or update_topology:
            at = self.time if update_topology else self.usd.Usd.TimeCode.Default()
            counts = numpy.full(len(corners) // 3, 3, numpy.int32)
            mesh.CreateFaceVertexCountsAttr().Set(self._ints(counts), at)
            mesh.CreateFaceVertexIndicesAttr().Set(self._ints(corners), at)
        mesh.CreatePointsAttr().Set(self._vectors(values), self.time)
        self._colors(mesh, colors, len(values), name)
        self._place(path, pos, rot, scale, visible)
        return path

    def render_line_list(self, name, vertices, indices, color=None, radius=0.01, visible=True):
        """Draws lines between pairs of points, which `indices` name two by two.

        Raises:
            ValueError: the indices are no pairs of points.
        """
        values, pairs = positions(vertices, name), indices_of(indices)
        if len(pairs) % 2 or (pairs.size and not 0 <= pairs.min() <= pairs.max() < len(values)):
            raise ValueError(f"expects pairs of the {len(values)} points of '{name}' as indices")
        return self._curves(name, values[pairs], len(pairs) // 2, 2, color, radius, visible)

    def render_line_strip(self, name, vertices, color=None, radius=0.01, visible=True):
        """Draws a line from point to point."""
        values = positions(vertices, name)
        lines = 1 if len(values) > 1 else 0
        return self._curves(name, values, lines, len(values), color, radius, visible)

    def render_points(self, name, points, radius, colors=None, as_spheres=True, visible=True):
        """Draws points.

        Args:
            points: positions, of shape (n, 3).
            radius: one for all or one for each.
            colors: one for all or one for each; None leaves them.
            as_spheres: accepted; viewers draw points as spheres.

        Raises:
            ValueError: numbers of radii or colours are not those of the points.
        """
        values = positions(points, name)
        radii = numpy.asarray(host(radius), numpy.float32).reshape(-1)
        if radii.size not in (1, len(values)):
            raise ValueError(
                f"expects one radius or {len(values)} for '{name}', but got {radii.size}"
            )
        path = self._path(name)
        made, _ = self._drawn_as(path, self.usd.UsdGeom.Points)
        made.CreatePointsAttr().Set(self._vectors(values), self.time)
        made.SetWidthsInterpolation("constant" if radii.size == 1 else "vertex")
        made.CreateWidthsAttr().Set(self.usd.Vt.FloatArray.FromNumpy(2.0 * radii), self.time)
        self._colors(made, colors, len(values), name)
        self._place(path, visible=visible)
        return path


def _check_triangles(corners, count, name) -> None:
    if len(corners) % 3:
        raise ValueError(
            f"expects three indices for each triangle of '{name}', but got {len(corners)}"
        )
    if len(corners) and not 0 <= corners.min() <= corners.max() < count:
        raise ValueError(f"expects indices of the {count} points of '{name}'")
