"""Kernels with tiles: code for blocks of a number of threads, and `wp.launch_tiled`.

Shapes of tiles depend on the number of threads of a block, so a kernel is translated for each that
it is launched with. On a CPU a block is one thread.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.argument_kinds import INTEGER, KERNEL, NONE, STREAM
from warp._src.arguments import explained
from warp._src.devices.devices import index_of, resolve_index
from warp._src.kernels.block_sizes import DEFAULT_THREADS, MOST_THREADS, block_threads
from warp._src.kernels.epoch import Epoch
from warp._src.kernels.kernel import Kernel, argument_type, once
from warp._src.kernels.launch import Checked, launch


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


class TiledKernel(Kernel):
    """Kernels whose translation meets a tile."""

    has_regions = False

    def for_blocks(self, arguments, threads):
        """The native kernel for blocks of that many threads.

        Args:
            arguments: native types of the arguments, of a generic kernel.
        """
        known = self.__dict__.setdefault("_by_threads", {})
        key = (Epoch.current, arguments, threads)
        return once(known, key, lambda: self._translate(arguments, threads))

    def reset(self) -> None:
        super().reset()
        self.__dict__.pop("_by_threads", None)
        self.__dict__.pop("_refused", None)

    def for_rows(self, device, threads):
        """The shared memory that launches of that many threads per index need, if known on that
        GPU.

        Returns:
            (native kernel, index of the device), None if more is to be looked at.
        """
        try:
            index = index_of.get(device)
        except TypeError:
            return None
        if index is None or index < 0 or self.epoch is not Epoch.current:
            return None
        # Generic kernels have types of arguments in place of None.
        found = self.__dict__.get("_by_threads", {}).get((Epoch.current, None, threads))
        return (found, index) if found is not None else None

    def place(self, native, dim, index, block_dim, values, recorded=False):
        """The native kernel for a launch, and its threads per block.

        Args:
            native: the one for blocks of one thread, if it can be.
            values: what the launch is given.
            recorded: arguments may be changed before it is run.

        Raises:
            WarpLaunchValueError: there are more than blocks have.
            WarpCodegenError: the kernel cannot be one for blocks of one thread, and these have one.
        """
        threads = block_threads(self, index, block_dim)
        if threads == 1 and index < 0:
            problem = self.__dict__.get("_refused", {}).get(native)
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
        types = tuple(map(argument_type, values)) if self.is_generic else None
        return self.for_blocks(types, threads), int(threads) if index >= 0 else 0

    def code_for(self, native, arch):
        """For GPUs, blocks of the option `block_dim`, or of 256 threads."""
        if not arch:
            return native
        return self.for_blocks(None, self.option("block_dim") or DEFAULT_THREADS)

    def launched_on(self, native, arch) -> list:
        """On GPUs, one for each size of blocks."""
        known = self.__dict__.get("_by_threads", {}) if arch else {}
        made = [
            found
            for (epoch, arguments, _), found in list(known.items())
            if epoch is Epoch.current and arguments is None
        ]
        return made or [self.code_for(native, arch)]


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
    kernel.note_tiles()
    first = (wished, kernel.option("block_dim"), DEFAULT_THREADS)
    for threads in dict.fromkeys((*first, 32, 64, 128, 512, 1024)):
        if not threads or not 1 < threads <= MOST_THREADS:
            continue
        try:
            native = kernel.for_blocks(arguments, threads)
        except errors.WarpCodegenError:
            continue
        fact = f"blocks of {threads} threads would do, but on a CPU a block is one thread"
        problem.notes = (*problem.notes, fact)
        problem.hint = problem.hint or "set `wp.config.enable_cpu_blocks = True`"
        kernel.__dict__.setdefault("_refused", {})[native] = problem
        return native
    raise problem


def launch_tiled(
    kernel, dim, inputs=(), outputs=(), *args, block_dim=0, device=None, stream=None, **options
):
    """Launches a block of threads per index of a grid.

    The same as `wp.launch` with the threads of a block as a last extent of the grid: 1 on a CPU,
    unless `config.enable_cpu_blocks` is set.

    Args:
        kernel: what `@wp.kernel` made.
        dim: extent, or up to three extents, of the grid of blocks.
        inputs, outputs, args: as for `wp.launch`.
        block_dim: threads of a block on a GPU, by default 256.
        options: the other arguments of `wp.launch`.

    Raises:
        WarpLaunchError: as `wp.launch` does.
    """
    # Searching kernels and those with launch constants are of other classes.
    if type(kernel) is TiledKernel and not (stream or args or options or Checked.active):
        place = kernel.for_rows(device, block_dim)
        extents = [*dim, block_dim] if isinstance(dim, (tuple, list)) else [dim, block_dim]
        if place is not None and len(extents) <= 4:
            native, index = place
            native.launch(extents, inputs, outputs, index, None, block_dim)
            return None
    try:
        args = inputs, outputs, *args
        return _launch_tiled(kernel, dim, args, block_dim, device, stream, options)
    except errors.WarpCodegenError as problem:
        # Says where in the kernel. Who keeps it is not to keep the kernel, too.
        del kernel
        raise problem.with_traceback(None) from problem.__cause__
    except (AttributeError, TypeError, ValueError) as error:
        unknown = options.keys() - {*launch.__code__.co_varnames[: launch.__code__.co_argcount]}
        if unknown:
            raise errors.WarpArgumentError(
                f"wp.launch_tiled(): got an unexpected argument '{min(unknown)}'"
            ) from None
        given = {
            "kernel": (KERNEL, kernel),
            "block_dim": (INTEGER | NONE, block_dim),
            "stream": (STREAM | NONE, stream),
        }
        raise explained(error, "wp.launch_tiled", **given) from None


def _launch_tiled(kernel, dim, args, block_dim, device, stream, options):
    if device is None and stream is not None:
        index = stream.device_index
    else:
        index = resolve_index(device)
    extents = list(dim) if isinstance(dim, (tuple, list)) else [dim]
    if len(extents) > 3:
        raise errors.WarpLaunchValueError(
            f"launch_tiled('{kernel.key}'): expects at most 3 extents, but got {len(extents)}"
        )
    threads = block_threads(kernel, index, block_dim)
    return launch(
        kernel, [*extents, threads], *args, device=device, stream=stream, block_dim=threads,
        **options,
    )  # fmt: skip
