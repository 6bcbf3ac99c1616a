"""`Mesh`: triangles that kernels search."""

from __future__ import annotations

import numbers

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import ARRAY, FLAG, INTEGER, TEXT
from warp._src.arguments import checked
from warp._src.derivatives.handles import Behind
from warp._src.devices import devices
from warp._src.forks import shared_lock
from warp._src.geometry.bvh import (
    Hierarchical,
    builds_on_device,
    check_array,
    check_group_count,
    check_groups,
    check_leaf_size,
    constructor_number,
)
from warp._src.geometry.mesh_arrays import POINT_GRADIENTS, VELOCITY_GRADIENTS
from warp._src.kernels import handle_checks
from warp._src.types import dtypes
from warp._src.types.scalars import int32
from warp._src.types.structs import StructInstance
from warp._src.weak import WeakValues

# Meshes that nobody has asked for winding numbers, by id.
_without_winding = WeakValues()
_supporting = shared_lock()


def support_winding(values) -> None:
    """Makes winding numbers quick for meshes whose ids are values of a launch.

    Not in the middle of a CUDA graph's recording: there all faces are asked.
    """
    if not _without_winding:
        return
    for value in values:
        if isinstance(value, StructInstance):
            support_winding([getattr(value, name) for name in value._wp_fields_])
            continue
        number = getattr(value, "value", value)
        mesh = _without_winding.get(number) if isinstance(number, numbers.Integral) else None
        if mesh is not None and (mesh.device.is_cpu or not mesh.device.is_capturing):
            with _supporting:
                mesh._support_winding()


handle_checks.prepare_winding = support_winding


class Mesh(Hierarchical, Behind):
    """A triangle mesh, which kernels search by its `id`.

    Args:
        points: array of vec3, positions of vertices. Kernels read it; after a change call `refit`.
            If it has gradients, derivatives of queries are added to them.
        indices: array of int32, three vertices per face, counter-clockwise seen from outside.
        velocities: array of vec3 like `points`, for `mesh_eval_velocity`.
        support_winding_number: prepares `mesh_query_point_sign_winding_number`, for 11 bytes per
            face. Else the first launch does that gets the mesh by an argument; where there is
            none, ids being in arrays or a graph recorded, all faces are asked.
        bvh_constructor: as of `Bvh`.
        bvh_leaf_size: changes nothing.
        groups: array of int32, a number for each face, for `mesh_get_group_root`.

    Attributes:
        id: what kernels get, as `wp.uint64`.
        report: what is in the hierarchy, and how many faces were NaN or infinite, as of `Bvh`.

    Raises:
        RuntimeError: an array is of another type, length, layout or device, or an index is out of
            range; the message names the face.
        ValueError: there is no such constructor, or the leaf size is not positive.

    Example:
        >>> import warp as wp
        >>> points = wp.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=wp.vec3, device="cpu")
        >>> wp.Mesh(points, wp.array([0, 1, 2], dtype=int, device="cpu")).report.depth
        1
    """

    @checked(
        points=ARRAY,
        indices=ARRAY,
        velocities=ARRAY,
        support_winding_number=FLAG,
        bvh_constructor=TEXT,
        bvh_leaf_size=INTEGER,
        groups=ARRAY,
    )
    def __init__(
        self,
        points,
        indices,
        velocities=None,
        support_winding_number=False,
        bvh_constructor=None,
        bvh_leaf_size=None,
        groups=None,
    ):
        check_array(points, "points", dtypes.vec3f)
        self._device = points.device
        self._check_velocities(velocities, points)
        self._check_indices(indices, points.device)
        check_leaf_size(1 if bvh_leaf_size is None else bvh_leaf_size)
        self.support_winding_number = bool(support_winding_number)
        there = builds_on_device(self.device, bvh_constructor)
        number = constructor_number(bvh_constructor, there)
        self._constructor = bvh_constructor
        check_groups(groups, points)
        check_group_count(groups, indices.size // 3, "a mesh", "faces")
        self._groups, self._faces = groups, indices.size // 3
        self._points, self._velocities, self._indices = points, velocities, indices
        if not there:
            self._wait()
        index = devices.resolve_index(self.device)
        by_host = self.support_winding_number and self.device.is_cpu
        self._native = _native.Mesh(points, velocities, indices, groups, index, number, by_host)
        self.id = self._native.id
        # The refit on the device, the build there, and the arrays that kernels know of.
        self._kernels = self._built = self._shown = self._moments = None
        if there:
            self._build(bvh_constructor)
            self._built.finish(points, indices)
        else:
            self._published()
            self._sum_moments()
        if not self.support_winding_number:
            _without_winding[self.id] = self

    def __reduce__(self):
        winding = self.support_winding_number
        arrays = self.points, self.indices, self.velocities
        return type(self), (*arrays, winding, self._constructor, None, self.groups)

    @staticmethod
    def _check_indices(indices, device):
        check_array(indices, "indices", int32, device)
        if indices.size % 3 != 0:
            raise errors.WarpError(f"faces have three indices, but there are {indices.size}")

    def _check_velocities(self, velocities, points):
        if velocities is None:
            return
        check_array(velocities, "velocities", dtypes.vec3f, points.device)
        if velocities.size != points.size:
            raise errors.WarpError(
                f"there are {points.size} points, but {velocities.size} velocities"
            )

    @property
    def indices(self):
        """Vertices of the faces; `refit` and `rebuild` take over another array."""
        return self._indices

    @indices.setter
    def indices(self, indices):
        self._check_indices(indices, self._device)
        self._indices = indices

    @property
    def points(self):
        """Positions of vertices; another array of the same length may take their place."""
        return self._points

    @points.setter
    @checked(points=ARRAY)
    def points(self, points):
        check_array(points, "points", dtypes.vec3f, self.device)
        if points.size != self._points.size:
            raise errors.WarpError(
                f"a mesh keeps its {self._points.size} points, but got {points.size}"
            )
        self._points = points
        self.refit()

    def _repr_html_(self):
        from warp._src.notebooks import mesh_html

        return mesh_html(self)

    @property
    def velocities(self):
        """Velocities of vertices, or None."""
        return self._velocities

    @velocities.setter
    @checked(velocities=ARRAY)
    def velocities(self, velocities):
        self._check_velocities(velocities, self._points)
        self._velocities = velocities
        self.refit()

    @property
    def report(self):
        """The primitives of the hierarchy."""
        return (self._built or self._native).report

    def refit(self):
        """Takes over positions that changed; neighbours in the hierarchy stay neighbours.

        On a GPU kernels do it, which graphs may capture, unless an array was replaced.

        Raises:
            RuntimeError: there are not as many faces as when it was built.
        """
        if self._indices.size != 3 * self._faces:
            raise errors.WarpError(
                f"a refitted mesh keeps its {self._faces} faces, but got "
                f"{self._indices.size // 3}; `rebuild` takes more or less"
            )
        if self._by_kernels and self._shown == self._addresses():
            self._by_kernels.refit(self._points, self.indices)
        elif not self._built:
            self._wait()
            self._native.refit(self._points, self._velocities, self.indices)
            self._published()
        else:
            self._build(self._constructor)
            return
        self._sum_moments()

    @property
    def _by_kernels(self):
        """The refit on the device, if the runtime does not do it."""
        return self._built or self._kernels

    def _published(self):
        """Called when the slot has been written."""
        self._shown = self._addresses()
        # The arrays behind the slot live on when the attributes are replaced.
        self._in_use = (self._points, self._velocities, self.indices)
        self._kernels = self._moments = None
        if not self.device.is_cpu and not self._built:
            from warp._src.geometry.device.refit import refit_of

            # Now, as what it needs cannot be made while a graph records.
            self._kernels = refit_of(self, of_triangles=True)
        if self._by_kernels:
            self._show_moments()
        self._enroll()

    def _show_moments(self):
        """Lets the slot lead to moments that kernels find."""
        view = (self._built or self._native).view
        if self.support_winding_number and len(view.order):
            from warp._src.geometry.device.moments import MOMENTS_IN_SLOT, Moments

            self._moments = Moments(view, self.device)
            _native.write_handle_word(self.id, MOMENTS_IN_SLOT, self._moments.moments.ptr)

    def _support_winding(self):
        if self.support_winding_number:
            return
        self.support_winding_number = True
        _without_winding.pop(self.id)
        self._wait()
        if self._by_kernels:
            self._show_moments()
            self._sum_moments()
        else:
            self._native.support_winding(self._points, self._velocities, self.indices)
            self._published()

    def _sum_moments(self):
        if self._moments is not None:
            self._moments.run()

    def _behind(self):
        return [
            (POINT_GRADIENTS, self._points, 0),
            (VELOCITY_GRADIENTS, self._velocities, 0),
        ]

    def _addresses(self) -> list:
        """The addresses of the arrays that kernels read."""
        arrays = (self._points, self._velocities, self.indices)
        return [getattr(array, "ptr", None) for array in arrays]

    @checked(bvh_constructor=TEXT)
    def rebuild(self, bvh_constructor=None):
        """Builds the hierarchy again, for positions that changed a lot.

        Where kernels do it, a graph captures it once it was done outside with the same arrays.

        Raises:
            RuntimeError: there are more or less groups than faces, or an index is out of range.
            ValueError: there is no such constructor.
        """
        check_group_count(self.groups, self.indices.size // 3, "a mesh", "faces")
        constructor = self._constructor if bvh_constructor is None else bvh_constructor
        there = builds_on_device(self.device, constructor)
        number = constructor_number(constructor, there)
        self._faces = self.indices.size // 3
        if there:
            self._build(constructor)
            return
        self._wait()
        arrays = (self._points, self._velocities, self.indices, self.groups)
        self._native.rebuild(*arrays, number)
        self._built = None
        self._published()
        self._sum_moments()

    def _build(self, constructor):
        """Builds on the device."""
        from warp._src.geometry.device.build import build_of

        given = self._points, self.indices, self.groups
        built = build_of(self._built, constructor, *given, True)
        self._adopt(built)
        built.run(self.id, self._points, self.indices)
        self._sum_moments()

    def _adopt(self, built):
        """Lets the slot lead to what is built on the device and to the arrays of now."""
        if built is self._built and self._shown == self._addresses():
            return
        if self._shown is not None:
            # Kernels that run may read the slot.
            self._wait()
        arrays = (self._points, self._velocities, self.indices)
        self._native.adopt(*arrays, *built.memory)
        self._built = built
        self._published()
