"""Adjoints of stencils without atomic additions: two launches in place of one.

The first one collects, for each element, what the threads around it add to its gradient; the second
one is the rest of the adjoint. The compiler takes them apart where it can (include/warp/Gather.h).
"""

from __future__ import annotations

import operator
import threading

from warp import _native, config


class Gathered:
    """The two parts of an adjoint, native kernels.

    Args:
        kernel: the kernel in Python.
        made: what the compiler has made of its adjoint.

    Attributes:
        sums: what is launched first.
        rest: what is launched after it, or None.
        atomics: atomic additions in `rest`.
    """

    def __init__(self, kernel, made):
        self.atomics = made.atomics
        self._is_new = True
        self._halo = made.halo
        self.sums = kernel.compile_module(made.sums)
        self.rest = None
        if made.rest is not None:
            self.rest = kernel.compile_module(made.rest)

    @property
    def parts(self) -> tuple:
        """(sums, rest, by how much the grid of the sums is larger) for `launch_adjoint`."""
        return self.sums, self.rest, tuple(self._halo)

    def fits(self, dim) -> bool:
        """True if it is right for a launch of these extents, see `GatheredAdjoint`."""
        extents = extents_of(dim)
        return len(extents) == len(self._halo) and max(extents) < 2**29

    def launch(self, call, values, hidden) -> None:
        """Runs both parts; arguments are those of the adjoint."""
        extents = extents_of(call.dim)
        larger = tuple(extent + more for extent, more in zip(extents, self._halo, strict=True))
        place = (call.device, call.stream, call.block_dim or 0)
        # Code for blocks of threads is for the dimensions of a launch.
        if self._is_new and call.device < 0 and not config.enable_cpu_blocks:
            self._compile_both(call)
        self.sums.launch(larger, values, [*hidden, *extents], *place)
        if self.rest is not None:
            self.rest.launch(call.dim, values, hidden, *place)

    def _compile_both(self, call) -> None:
        """Compiles both parts for the CPU at the same time."""
        self._is_new = False
        if self.rest is not None:
            place = (call.device, call.block_dim or 0)
            threading.Thread(target=_native.load_kernel, args=(self.rest, *place)).start()
            _native.load_kernel(self.sums, *place)


def gather_sums(kernel, adjoint) -> Gathered | None:
    """The parts of an adjoint, given as a module, if additions can be gathered.

    Checks of bounds are about the accesses of the adjoint as it is, so a kernel in debug mode stays
    whole.
    """
    if kernel.option("mode") == "debug":
        return None
    made = _native.gather_sums(adjoint)
    return None if made is None else Gathered(kernel, made)


def extents_of(dim) -> tuple[int, ...]:
    """The extents of a launch, of one or several dimensions."""
    return tuple(map(operator.index, dim)) if hasattr(dim, "__len__") else (operator.index(dim),)
