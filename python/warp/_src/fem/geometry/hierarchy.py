"""Hierarchies of boxes of cells per device, for look-up."""

import functools

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import forget
from warp._src.fem.types import Ints


@functools.cache
def _groups_kernel(record):
    CellArg, environment_of = record.functions.CellArg, record.functions.cell_environment_index

    @wp.kernel(enable_backward=False)
    def write_environments(arg: CellArg, groups: Ints):
        groups[wp.tid()] = environment_of(arg, wp.tid())

    return write_environments


class CellHierarchy:
    """The `wp.Bvh` of a geometry's cells, and the box of all, per device."""

    def __init__(self, geometry):
        self._geometry, self._built = geometry, {}

    def has(self, device) -> bool:
        """The hierarchy was built for a device."""
        return wp.get_device(device).alias in self._built

    def id(self, device):
        """Handle of the hierarchy, 0 if there is none."""
        found = self._built.get(wp.get_device(device).alias)
        return found[0].id if found and found[0] else wp.uint64(0)

    def fill(self, arg, device) -> None:
        """Fills the fields `bvh` and `box` of an argument of cells."""
        found = self._built.get(wp.get_device(device).alias)
        if found and found[0]:
            bvh, arg.box, arg.lowers, arg.uppers = found
            arg.bvh = bvh.id

    def build(self, device=None) -> None:
        """Builds the hierarchy from scratch."""
        geometry, device = self._geometry, wp.get_device(device)
        count = geometry.cell_count()
        with extend.unrecorded():
            lowers, uppers = (wp.empty(count, dtype=wp.vec3, device=device) for _ in range(2))
            box = wp.empty(2, dtype=wp.vec3, device=device)
            self._write(device, lowers, uppers, box)
            groups = self.groups(device)
            bvh = wp.Bvh(lowers, uppers, groups=groups) if count else None
        self._built[device.alias] = (bvh, box, lowers, uppers)
        forget(geometry, "cell_arg_value", "side_arg_value", "side_index_arg_value")

    def update(self, device=None) -> None:
        """Fits the hierarchy to new positions; builds it where there is none."""
        device = wp.get_device(device)
        if device.alias not in self._built:
            return self.build(device)
        bvh, box, lowers, uppers = self._built[device.alias]
        with extend.unrecorded():
            self._write(device, lowers, uppers, box)
            if bvh:
                bvh.refit()

    def _write(self, device, lowers, uppers, box) -> None:
        from warp._src.fem.geometry.mesh_lookup import bounds_kernel

        geometry = self._geometry
        box[0:1].fill_(wp.vec3(float("inf")))
        box[1:2].fill_(wp.vec3(float("-inf")))
        inputs, outputs = [geometry.cell_arg_value(device)], [lowers, uppers, box]
        kernel = bounds_kernel(geometry.record)
        wp.launch(kernel, geometry.cell_count(), inputs, outputs, device=device)

    def groups(self, device):
        """Environments of cells, None if there is one."""
        geometry = self._geometry
        if geometry.environment_count() <= 1:
            return None
        if geometry.cell_env is not None:
            return geometry.cell_env.to(device)
        groups = wp.empty(geometry.cell_count(), dtype=wp.int32, device=device)
        inputs, kernel = [geometry.cell_arg_value(device)], _groups_kernel(geometry.record)
        wp.launch(kernel, geometry.cell_count(), inputs, [groups], device=device)
        return groups


class HasHierarchy:
    """Look-up of geometries with a `CellHierarchy` as `_hierarchy`."""

    _hierarchy: CellHierarchy

    def supports_cell_lookup(self, device=None) -> bool:
        """`lookup` works on a device: `build_bvh` was called for it."""
        return self._hierarchy.has(device)

    def build_bvh(self, device=None) -> None:
        """Builds the hierarchy of boxes of cells that `lookup` needs."""
        self._hierarchy.build(device)

    def update_bvh(self, device=None) -> None:
        """Fits the hierarchy of boxes to new positions, or builds it."""
        self._hierarchy.update(device)

    def cell_bvh_groups(self, device=None):
        """Groups of the hierarchy: environments of cells, None if there is one."""
        return self._hierarchy.groups(wp.get_device(device))

    def bvh_id(self, device=None):
        """Handle of the hierarchy of boxes, 0 if there is none."""
        return self._hierarchy.id(device)
