"""Kernels that search geometry: each launch checks the handles that it passes."""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.devices.devices import by_index
from warp._src.kernels.kernel import Kernel

_NAMES = {1: "HashGrid", 2: "Bvh", 3: "Mesh", 4: "Volume"}


class SearchingKernel(Kernel):
    """Kernels that query one of their arguments.

    Attributes:
        handles: kinds of geometry, by the names of arguments.
        sums_winding: whether winding numbers are asked for.
    """

    def check(self, values, device) -> None:
        """Checks the handles among the values of a launch.

        Raises:
            WarpLaunchValueError: one is not that of a live object of its kind on the device.
        """
        super().check(values, device)
        names = self.func.__code__.co_varnames
        for name, kind in self.handles.items():
            position = names.index(name)
            if position >= len(values):
                continue
            value = getattr(values[position], "value", values[position])
            problem = _native.describe_handle(int(value), kind, device)
            if problem:
                raise errors.WarpLaunchValueError(
                    f"launch('{self.key}'): argument '{name}' expects the id of a live "
                    f"{_NAMES[kind]} on '{by_index(device).alias}', but got {problem}"
                )
        if self.sums_winding:
            from warp._src.geometry.mesh import support_winding

            support_winding(values)
