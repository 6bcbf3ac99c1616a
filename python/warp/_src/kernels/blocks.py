"""Blocks of kernels with tiles: a native kernel for each number of threads of a block.

Shapes of tiles depend on the number of threads of a block, so a kernel is translated for each that
it is launched with. On a CPU a block is one thread.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.devices.devices import index_of
from warp._src.kernels.block_sizes import DEFAULT_THREADS, MOST_THREADS, block_threads
from warp._src.kernels.epoch import Epoch
from warp._src.kernels.hooks import LaunchHook
from warp._src.kernels.specializing import argument_type, once

# Threads of a warp.
WARP = 32


class RaggedBlock(int):
    """Threads of blocks that are not rows of a launch: threads that follow each other, whatever the
    extents are, of which the last block may lack some."""

    __slots__ = ()
    is_ragged = True

    def __repr__(self):
        return f"ragged {int(self)}"

    def __hash__(self):
        return hash((int(self), "ragged"))

    def __eq__(self, other):
        return type(other) is RaggedBlock and int(self) == int(other)


class BlockCode(LaunchHook):
    """The hook of a kernel whose translation met a tile."""

    role = "blocks"
    has_regions = False

    def __init__(self):
        # By epoch, native types of the arguments of a generic kernel, and threads of a block.
        self._known: dict = {}
        # Why there is none for blocks of one thread, by what stands in its place.
        self.refused: dict = {}
        # Indices that threads ask for, if a warp is enough for blocks of more dimensions.
        self.warp_rank = 0

    def threads_of_row(self, rank, threads):
        """Threads of the blocks of a launch of that many dimensions of blocks.

        A warp factors small matrices without a barrier, so where the number of threads makes no
        difference to results (lib/Compiler/WarpBlocks.cpp), larger blocks are of one.
        """
        return WARP if 0 < self.warp_rank <= rank and threads > WARP else threads

    def for_blocks(self, kernel, arguments, threads):
        """The native kernel for blocks of that many threads.

        Args:
            arguments: native types of the arguments, of a generic kernel.
        """
        key = (Epoch.current, arguments, threads)
        return once(self._known, key, lambda: kernel._translate(arguments, threads))

    def reset(self) -> None:
        self._known.clear()
        self.refused.clear()
        self.warp_rank = 0

    def for_rows(self, kernel, device, threads):
        """The native kernel for launches of that many threads per index, if that GPU has one.

        Returns:
            (native kernel, index of the device), None if more is to be looked at.
        """
        try:
            index = index_of.get(device)
        except TypeError:
            return None
        if index is None or index < 0 or kernel.epoch is not Epoch.current:
            return None
        # Generic kernels have types of arguments in place of None.
        found = self._known.get((Epoch.current, None, threads))
        return (found, index) if found is not None else None

    def place(self, kernel, native, dim, index, block_dim, values, recorded):
        """The native kernel for a launch, and its threads per block.

        Raises:
            WarpLaunchValueError: there are more than blocks have.
            WarpCodegenError: the kernel cannot be one for blocks of one thread, and these have one.
        """
        threads = block_threads(kernel, index, block_dim)
        if threads == 1 and index < 0:
            problem = self.refused.get(native)
            if problem is not None:
                raise problem.with_traceback(None)
            return native, 0
        extents = tuple(dim) if isinstance(dim, (tuple, list)) else (dim,)
        if len(extents) == 1:
            is_row = index < 0 or extents[0] % threads == 0
        else:
            is_row = extents[-1] == threads
        if not is_row:
            threads = RaggedBlock(threads)
        types = tuple(map(argument_type, values)) if kernel.is_generic else None
        return self.for_blocks(kernel, types, threads), int(threads) if index >= 0 else 0

    def code_for(self, kernel, native, arch):
        """For GPUs, blocks of the option `block_dim`, or of 256 threads."""
        if not arch:
            return native
        return self.for_blocks(kernel, None, kernel.option("block_dim") or DEFAULT_THREADS)

    def launched_on(self, kernel, native, arch) -> list:
        """On GPUs, one for each size of blocks."""
        made = [
            found
            for (epoch, arguments, _), found in list(self._known.items())
            if arch and epoch is Epoch.current and arguments is None
        ]
        return made or [self.code_for(kernel, native, arch)]


def block_code(kernel) -> BlockCode:
    """The hook that chooses the code for blocks; added to a kernel that has none.

    Raises:
        WarpCodegenError: the kernel has launch constants.
    """
    found = kernel.hook("blocks")
    if found is None:
        if kernel.hook("constants") is not None:
            raise errors.WarpCodegenError(
                f"kernel '{kernel.key}' has tiles, whose code is for blocks of one size, and "
                "cannot have `launch_constants`; capture the constants instead"
            )
        found = BlockCode()
        kernel.add_hook(found)
    return found


def for_more_threads(kernel, problem, arguments, wished):
    """The native kernel for blocks of several threads where there is none for blocks of one, as
    where a kernel picks the 25th of `wp.tile(x)`.

    Args:
        problem: why there is none.
        arguments: native types of the arguments, of a generic kernel.
        wished: threads of the blocks of a launch, if it says how many.

    Raises:
        WarpCodegenError: the problem, which other numbers of threads that are common have, too.
    """
    blocks = block_code(kernel)
    first = (wished, kernel.option("block_dim"), DEFAULT_THREADS)
    for threads in dict.fromkeys((*first, 32, 64, 128, 512, 1024)):
        if not threads or not 1 < threads <= MOST_THREADS:
            continue
        try:
            native = blocks.for_blocks(kernel, arguments, threads)
        except errors.WarpCodegenError:
            continue
        fact = f"blocks of {threads} threads would do, but on a CPU a block is one thread"
        problem.notes = (*problem.notes, fact)
        problem.hint = problem.hint or "set `wp.config.enable_cpu_blocks = True`"
        blocks.refused[native] = problem
        return native
    raise problem
