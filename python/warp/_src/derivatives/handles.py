"""Derivatives by arrays that kernels know by a handle: vertices of meshes, voxels of volumes.

A slot (lib/Geometry/Slots.h) says where the gradients of such arrays are; without any it says 0. It
is brought up to date before an adjoint runs. In forward mode it says where the tangents are, for as
long as the launch takes.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.devices import devices
from warp._src.weak import WeakObjects

_alive = WeakObjects()
# Not empty if there is geometry whose numbers may have gradients.
alive = _alive.entries


class Behind:
    """Geometry whose numbers may have gradients.

    A subclass has `id`, `device` and `_behind()`: for each word of the slot that leads to
    gradients the array, or None, and from where addresses count.
    """

    def _enroll(self) -> None:
        """Called when the slot has been written: its words lead to what `_shown` says."""
        self._shown_gradients = {
            word: _address(one and one.grad_ptr, start) for word, one, start in self._behind()
        }
        _alive.add(self)

    def _behind(self) -> list:
        raise NotImplementedError

    def _tangents(self, tangents, one):
        """The tangents of one of the arrays as kernels read them, along all directions."""
        return tangents.packed(one)

    def _point(self, word, address) -> None:
        """Lets a word of the slot lead to an address."""
        if self._shown_gradients.get(word) == address:
            return
        if not self.device.is_cpu:
            if _native.is_capturing(devices.resolve_index(self.device)):
                raise errors.WarpError(
                    f"a graph captures derivatives by a {type(self).__name__} whose gradients were "
                    "there before; run them once outside"
                )
            # Kernels that run may read it.
            devices.synchronize_device(self.device)
        _native.write_handle_word(self.id, word, address)
        self._shown_gradients[word] = address


def _address(pointer, start) -> int:
    """The words of a slot for an array of gradients at an address."""
    return (pointer - start) % 2**64 if pointer else 0


def show_gradients(in_use=False) -> list:
    """Brings all slots up to date; gives the arrays of gradients.

    in_use: slots do not lead to gradients that nobody has used yet.
    """
    if not _alive:
        return []
    found = []
    for owner in list(_alive):
        for word, one, start in owner._behind():
            gradient = None if one is None else one.grad_in_use if in_use else one.grad
            owner._point(word, _address(gradient and gradient.ptr, start))
            if gradient is not None:
                found.append(gradient)
    return found


def arrays_of(call) -> list:
    """The arrays behind the handles that are arguments of a launch."""
    checks = call.kernel.hook("handles")
    if checks is None or not _alive:
        return []
    values = [call.values[position] for _, position, _ in checks.kinds]
    ids = {int(getattr(value, "value", value)) for value in values}
    return [
        one
        for owner in list(_alive)
        if owner.id in ids
        for _, one, _ in owner._behind()
        if one is not None
    ]


class Showing(_native.Scope):
    """Lets slots lead to tangents, one direction after the other, in the block."""

    _kept = None

    def __init__(self, tangents):
        self.tangents = tangents

    def _enter(self):
        self._kept = []
        for owner in list(_alive):
            for word, one, start in owner._behind():
                packed = None
                if one is not None and self.tangents.has(one):
                    packed = owner._tangents(self.tangents, one)
                    self._kept.append(packed)
                owner._point(word, _address(packed and packed.ptr, start))

    def _restore(self):
        if self._kept is not None:
            # Nobody reads them any more when the memory is given back.
            show_gradients(in_use=True)
        self._kept = None
