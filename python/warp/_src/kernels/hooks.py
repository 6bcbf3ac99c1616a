"""Launch hooks: work that launches of some kernels need besides the launch itself.

A kernel that searches geometry checks the handles it is passed, one with tiles has code for each
size of blocks, one with launch constants has code for sets of values. Each of them adds a hook to
`Kernel.hooks` when it is made or translated; launches of a kernel without hooks call none.
"""

from __future__ import annotations

import typing


class LaunchHook:
    """Does nothing; each kind of hook overrides what it needs.

    Attributes:
        role: names the kind; a kernel has at most one hook of a role.
        has_regions: False if the elements of arrays that a launch accesses are not known.
    """

    role: typing.ClassVar[str] = ""
    has_regions: typing.ClassVar[bool] = True

    def check(self, kernel, values, device) -> None:
        """Checks the values of a launch on a device (an index)."""

    def place(self, kernel, native, dim, index, block_dim, values, recorded):
        """Chooses the native kernel of a launch, and its threads per block.

        Args:
            kernel: what `@wp.kernel` made.
            native: the native kernel that launches without the hook run.
            dim: extent or extents.
            index: of the device; negative is the CPU.
            block_dim: threads per block that the launch asks for, or None.
            values: what the launch is given.
            recorded: True if arguments may change before the launch runs.
        """
        return native, block_dim

    def code_for(self, kernel, native, arch):
        """The code for an architecture; 0 is the CPU."""
        return native

    def launched_on(self, kernel, native, arch) -> list:
        """The native kernels that launches on an architecture have used."""
        return [native]

    def reset(self) -> None:
        """Forgets what was translated."""
