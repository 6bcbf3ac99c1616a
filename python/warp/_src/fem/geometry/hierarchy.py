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


class HasHierarchy:
    """Look-up of geometries by a `wp.Bvh` of the boxes of cells, and the box of all, per device."""

    @property
    def _built(self) -> dict:
        return self.__dict__.setdefault("_hierarchies", {})

    def supports_cell_lookup(self, device=None) -> bool:
        """`lookup` works on a device: `build_bvh` was called for it."""
        return wp.get_device(device).alias in self._built

    def bvh_id(self, device=None):
        """Handle of the hierarchy of boxes, 0 if there is none."""
        found = self._built.get(wp.get_device(device).alias)
        return found[0].id if found and found[0] else wp.uint64(0)

    def _fill_hierarchy(self, arg, device) -> None:
        """Fills the fields `bvh` and `box` of an argument of cells."""
        found = self._built.get(wp.get_device(device).alias)
        if found and found[0]:
            bvh, arg.box, arg.lowers, arg.uppers = found
            arg.bvh = bvh.id

    def build_bvh(self, device=None) -> None:
        """Builds the hierarchy of boxes of cells that `lookup` needs."""
        device, count = wp.get_device(device), self.cell_count()
        with extend.unrecorded():
            lowers, uppers = (wp.empty(count, dtype=wp.vec3, device=device) for _ in range(2))
            box = wp.empty(2, dtype=wp.vec3, device=device)
            self._write_boxes(device, lowers, uppers, box)
            groups = self.cell_bvh_groups(device)
            bvh = wp.Bvh(lowers, uppers, groups=groups) if count else None
        self._built[device.alias] = (bvh, box, lowers, uppers)
        forget(self, "cell_arg_value", "side_arg_value")

    def update_bvh(self, device=None) -> None:
        """Fits the hierarchy of boxes to new positions, or builds it."""
        device = wp.get_device(device)
        if device.alias not in self._built:
            return self.build_bvh(device)
        bvh, box, lowers, uppers = self._built[device.alias]
        with extend.unrecorded():
            self._write_boxes(device, lowers, uppers, box)
            if bvh:
                bvh.refit()

    def _write_boxes(self, device, lowers, uppers, box) -> None:
        from warp._src.fem.geometry.mesh_lookup import bounds_kernel

        box[0:1].fill_(wp.vec3(float("inf")))
        box[1:2].fill_(wp.vec3(float("-inf")))
        inputs, outputs = [self.cell_arg_value(device)], [lowers, uppers, box]
        wp.launch(bounds_kernel(self.record), self.cell_count(), inputs, outputs, device=device)

    def cell_bvh_groups(self, device=None):
        """Groups of the hierarchy: environments of cells, None if there is one."""
        device = wp.get_device(device)
        if self.environment_count() <= 1:
            return None
        if self.cell_env is not None:
            return self.cell_env.to(device)
        groups = wp.empty(self.cell_count(), dtype=wp.int32, device=device)
        inputs, kernel = [self.cell_arg_value(device)], _groups_kernel(self.record)
        wp.launch(kernel, self.cell_count(), inputs, [groups], device=device)
        return groups
