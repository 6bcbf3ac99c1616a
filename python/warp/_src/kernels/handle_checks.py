"""Handle checks: launches of kernels that search geometry check the handles they are passed."""

from __future__ import annotations

import typing

from warp import _native
from warp._src import errors
from warp._src.device_table import KINDS
from warp._src.devices.devices import by_index
from warp._src.kernels.hooks import LaunchHook

_NAMES = {number: name for name, number in KINDS.items()}
# prepare_winding(values): prepares the meshes among the values of a launch for winding numbers.
# `geometry.mesh` puts it here; without that module there are no meshes.
prepare_winding: typing.Callable | None = None


class HandleChecks(LaunchHook):
    """The hook of a kernel whose translation met a query of one of its arguments.

    Args:
        kernel: the kernel.
        kinds: kinds of geometry, by the names of parameters.
        sums_winding: True if the kernel asks for winding numbers.
    """

    role = "handles"

    def __init__(self, kernel, kinds, sums_winding):
        names = kernel.func.__code__.co_varnames
        self.kinds = [(name, names.index(name), kind) for name, kind in kinds.items()]
        self.sums_winding = sums_winding

    def check(self, kernel, values, device) -> None:
        """Checks the handles among the values of a launch.

        Raises:
            WarpLaunchValueError: one is not that of a live object of its kind on the device.
        """
        for name, position, kind in self.kinds:
            if position >= len(values):
                continue
            value = values[position]
            if type(value) is not int:
                value = getattr(value, "value", value)
            problem = _native.describe_handle(int(value), kind, device)
            if problem:
                raise errors.WarpLaunchValueError(
                    f"launch('{kernel.key}'): argument '{name}' expects the id of a live "
                    f"{_NAMES[kind]} on '{by_index(device).alias}', but got {problem}"
                )
        if self.sums_winding and prepare_winding is not None:
            prepare_winding(values)
