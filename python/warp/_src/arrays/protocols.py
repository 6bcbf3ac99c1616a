"""The protocols by which other libraries read an array: array interfaces and DLPack."""

from __future__ import annotations

from warp._src.arrays import hooks
from warp._src.arrays.observers import Observers
from warp._src.devices import devices
from warp._src.interop.dlpack_export import dlpack_device, export
from warp._src.interop.exchange import current_handle
from warp._src.types.numpy_types import element_layout


def _packed_strides(shape, step) -> list:
    """Strides as NumPy counts them, of nothing as well."""
    strides = []
    for extent in reversed(shape):
        strides.insert(0, step)
        step *= extent
    return strides


class ArrayProtocols:
    """Mixin of `array`."""

    __slots__ = ()

    @property
    def __array_interface__(self):
        if self.device_index != devices.CPU:
            raise AttributeError(f"no `__array_interface__`: the array is on '{self.device}'")
        if hooks.captures:
            hooks.check_settled(self)
        if Observers.active:
            Observers.lend(self)
        return self._interface()

    @property
    def __cuda_array_interface__(self):
        if self.device_index == devices.CPU:
            raise AttributeError("no `__cuda_array_interface__`: the array is on 'cpu'")
        interface = self._interface()
        # Readers wait for this stream before they touch the memory.
        interface["stream"] = current_handle(self.device_index)
        return interface

    def _interface(self) -> dict:
        number, inner = element_layout(self.dtype)
        strides = list(self.strides)
        if self.size == 0:
            strides = _packed_strides(self.shape, self.item_size)
        step = self.item_size
        for extent in inner:
            step //= extent
            strides.append(step)
        # NumPy asks for an address also where there is nothing to read.
        address = self.ptr or (id(self) if self.size == 0 else 0)
        interface = {
            "data": (address, self.read_only),
            "shape": self.shape + inner,
            "strides": tuple(strides),
            "typestr": number.str,
            "version": 3,
        }
        if number.names:
            interface["descr"] = number.descr
        return interface

    def __dlpack__(self, stream=None, max_version=None, dl_device=None, copy=None):
        """A DLPack capsule over the memory, for `from_dlpack` of other libraries."""
        if Observers.active and self.device_index == devices.CPU:
            Observers.lend(self)
        return export(self, stream, max_version, dl_device, copy)

    def __dlpack_device__(self) -> tuple[int, int]:
        """Kind and number of the device, as DLPack counts them."""
        return dlpack_device(self)
