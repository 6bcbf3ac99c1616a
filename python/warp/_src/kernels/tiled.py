"""`wp.launch_tiled`: launches a block of threads per index of a grid."""

from __future__ import annotations

from warp._src import errors
from warp._src.argument_kinds import INTEGER, KERNEL, NONE, STREAM
from warp._src.arguments import explained
from warp._src.devices.devices import resolve_index
from warp._src.kernels.block_sizes import block_threads
from warp._src.kernels.blocks import WARP
from warp._src.kernels.launch import Checked, launch


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
    hooks = getattr(kernel, "hooks", ())
    # Handle checks are left to `launch`.
    if (
        len(hooks) == 1
        and hooks[0].role == "blocks"
        and not (stream or args or options or Checked.active)
    ):
        rows = [*dim] if isinstance(dim, (tuple, list)) else [dim]
        threads = hooks[0].threads_of_row(len(rows), block_dim)
        place = hooks[0].for_rows(kernel, device, threads)
        if place is not None and len(rows) < 4:
            native, index = place
            native.launch([*rows, threads], inputs, outputs, index, None, threads)
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
    if index >= 0 and threads > WARP and all(extents) and not options.get("record_cmd"):
        threads = _threads_of_row(kernel, len(extents), threads)
    return launch(
        kernel, [*extents, threads], *args, device=device, stream=stream, block_dim=threads,
        **options,
    )  # fmt: skip


def _threads_of_row(kernel, rank, threads):
    """Threads of the blocks on a GPU; fewer than asked for where a warp is enough."""
    if kernel.is_generic:
        return threads
    kernel.prepare(threads)
    blocks = kernel.hook("blocks")
    return blocks.threads_of_row(rank, threads) if blocks is not None else threads
