"""`wp.launch`: runs a kernel over a grid of threads.

The work is done by the native kernel, which checks and packs the arguments, picks the compiled
variant and starts it. This function finds the device, and sends the rare cases (printing, checking,
recording, adjoints) to a slower path.
"""

from __future__ import annotations

import math
import sys
import time
import typing

from warp import _native, config
from warp._src import config as settings
from warp._src import errors
from warp._src.argument_kinds import DIM, FLAG, INTEGER, KERNEL, LIST, NONE, STREAM
from warp._src.arguments import explained, misfit
from warp._src.arrays.array import array
from warp._src.arrays.observers import Observers, launch_ordinary, observed_launch
from warp._src.derivatives.adjoint_launch import AdjointLaunch, launch_again, launch_plain
from warp._src.derivatives.gathers import extents_of
from warp._src.devices.devices import by_index, index_of, resolve_index
from warp._src.kernels.block_sizes import block_threads
from warp._src.kernels.call import Call
from warp._src.kernels.epoch import Epoch
from warp._src.kernels.kernel import Kernel
from warp._src.kernels.parameters import LaunchParameters, values_at_first
from warp._src.logger import get_logger


class Checked:
    """True if a setting asks for something to be done at each launch, or somebody observes."""

    active = False
    # By a setting.
    asked = False

    @classmethod
    def update(cls, value=None):
        cls.asked = config.print_launches or config.verify_fp or config.verify_cuda
        cls.active = cls.asked or Observers.active


Observers.on_change(Checked.update)
for _name in ("print_launches", "verify_fp", "verify_cuda"):
    settings.on_change(_name, Checked.update)


def launch(
    kernel,
    dim,
    inputs=(),
    outputs=(),
    adj_inputs=(),
    adj_outputs=(),
    device=None,
    stream=None,
    adjoint=False,
    record_tape=True,
    record_cmd=False,
    max_blocks=0,
    block_dim=0,
):
    """Runs a kernel once per index of a grid.

    Args:
        kernel: what `@wp.kernel` made.
        dim: extent, or up to four extents, of the grid; a zero makes the launch do nothing: if it
            would be the kernel's first, not even what takes time, to translate the function and to
            look at its arguments.
        inputs: one value per kernel parameter, in order.
        outputs: values of the remaining parameters.
        device: where to run; the arrays must be reachable from there.
        stream: CUDA stream to queue on.
        adj_inputs, adj_outputs: with `adjoint`, arrays of gradients to use in place of those that
            the arguments have; None, and whatever belongs to no array, stands for the latter.
            Gradients named here of arrays that the launch only writes stay as they are.
        adjoint: run the derivative instead: it takes the gradients of what the launch has written,
            and adds to those of what it has read.
        record_tape: False keeps the launch from the tape that is recording.
        record_cmd: return a `Launch` to be run later, and do not run now.
        block_dim: CUDA threads per block.

    Raises:
        WarpLaunchError: an argument has the wrong type, rank or device, or `dim` is impossible.
        WarpCodegenError: the kernel cannot be translated.
    """
    try:
        index = index_of.get(device)
    except TypeError:
        index = None
    try:
        if not (
            index is None
            or stream is not None
            or kernel.epoch is not Epoch.current
            or adjoint
            or record_cmd
        ):
            if not Checked.active:
                if kernel.hooks:
                    return _launch_hooked(kernel, dim, inputs, outputs, index, block_dim)
                kernel.native.launch(dim, inputs, outputs, index, None, block_dim or 0)
                return None
            if not (Checked.asked or kernel.hooks) and launch_ordinary(
                kernel, dim, inputs, outputs, index, block_dim or 0, record_tape
            ):
                return None
        elif (
            adjoint
            and kernel.epoch is Epoch.current
            and not (index is None or stream is not None or record_cmd or Checked.active)
            and launch_again(
                kernel, dim, inputs, outputs, adj_inputs, adj_outputs, index, block_dim or 0
            )
        ):
            return None
        return _launch_checked(
            kernel,
            dim,
            inputs,
            outputs,
            device,
            stream,
            (adj_inputs, adj_outputs) if adjoint else None,
            record_tape,
            record_cmd,
            block_dim,
        )
    except errors.WarpCodegenError as problem:
        # Says where in the kernel. Who keeps it is not to keep the kernel, too.
        del kernel
        raise problem.with_traceback(None) from problem.__cause__
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        _check_kernel(kernel)
        given = {
            "dim": (DIM, dim),
            "block_dim": (INTEGER | NONE, block_dim),
            "stream": (STREAM | NONE, stream),
        }
        raise explained(error, "wp.launch", **given) from error.__cause__


def _launch_hooked(kernel, dim, inputs, outputs, index, block_dim) -> None:
    """The fast path of a kernel with hooks, which choose its code and may reject the launch."""
    if not isinstance(inputs, (list, tuple)) or not isinstance(outputs, (list, tuple)):
        inputs, outputs = _sequence(inputs, kernel, "inputs"), _sequence(outputs, kernel, "outputs")
    values, native = (*inputs, *outputs), kernel.native
    for hook in kernel.hooks:
        hook.check(kernel, values, index)
        native, block_dim = hook.place(kernel, native, dim, index, block_dim, values, False)
    native.launch(dim, values, (), index, None, block_dim or 0)


def _launch_checked(
    kernel, dim, inputs, outputs, device, stream, gradients, record_tape, record_cmd, block_dim
):
    """The same with all checks, for the first launch and for what the fast path leaves."""
    _check_kernel(kernel)
    begin = time.perf_counter() if config.verbose else 0.0
    if device is None and stream is not None:
        index = stream.device_index
    else:
        index = resolve_index(device)
    inputs, outputs = _sequence(inputs, kernel, "inputs"), _sequence(outputs, kernel, "outputs")
    if config.print_launches and gradients is None and not record_cmd:
        get_logger().info(f"kernel: {kernel.key} dim: {dim} device: {by_index(index).alias}")
    is_first = kernel.epoch is not Epoch.current
    if is_first and gradients is None and not record_cmd and _is_empty(dim):
        return None
    if kernel.is_generic:
        native = kernel.specialize((*inputs, *outputs), block_dim)
    else:
        native = kernel.prepare(block_dim)
    translated = time.perf_counter() if config.verbose else 0.0
    wished = block_dim
    if kernel.hooks:
        kernel.check((*inputs, *outputs), index)
        native, block_dim = kernel.place(
            native, dim, index, block_dim, (*inputs, *outputs), record_cmd
        )
    if gradients is not None:
        place = (index, stream, block_dim or 0)
        if type(dim) not in (int, tuple, list):
            dim = extents_of(dim)
        return _launch_adjoint(kernel, native, dim, inputs, outputs, gradients, place, record_cmd)
    if record_cmd:
        place = (index, stream, block_dim or 0)
        made = Launch._packed(kernel, native, dim, inputs, outputs, *place)
        made.block_dim = block_threads(kernel, index, wished)
        return made
    if Observers.active:
        rare = native is not kernel.native or stream is not None or Checked.asked or kernel.hooks
        if rare or not launch_ordinary(
            kernel, dim, inputs, outputs, index, block_dim or 0, record_tape
        ):
            values = (*inputs, *outputs)
            observed_launch(
                Call(kernel, native, dim, values, index, stream, block_dim), record_tape
            )
    else:
        native.launch(dim, inputs, outputs, index, stream, block_dim or 0)
    if config.verify_cuda and index >= 0:
        _native.synchronize_device(index)
    if config.verify_fp:
        _verify(kernel, native, (*inputs, *outputs))
    if config.verbose:
        _report(kernel, native, translated - begin, time.perf_counter() - begin)
    return None


def _check_kernel(kernel) -> None:
    if not isinstance(kernel, Kernel):
        raise errors.WarpLaunchTypeError(
            f"launch: expects a kernel, but got '{type(kernel).__name__}', "
            f"decorate the function with `@wp.kernel`"
        ) from None


def _is_empty(dim) -> bool:
    """True if a grid has no threads, and nothing is wrong with its extents."""
    if type(dim) is int:
        return dim == 0
    if type(dim) not in (tuple, list) or not 1 <= len(dim) <= 4:
        return False
    return 0 in dim and all(type(extent) is int and extent >= 0 for extent in dim)


def _launch_adjoint(kernel, native, dim, inputs, outputs, gradients, place, record_cmd):
    first, second = (_sequence(given, kernel, "gradients") for given in gradients)
    if len(first) > len(inputs):
        raise errors.WarpLaunchValueError(
            f"launch('{kernel.key}', adjoint=True): expects at most {len(inputs)} 'adj_inputs', "
            f"but got {len(first)}"
        )
    missing = [None] * (len(inputs) - len(first))
    values, named = (*inputs, *outputs), (*first, *missing, *second)
    if not record_cmd and launch_plain(kernel, native, dim, values, named, place):
        return None
    recorded = AdjointLaunch(kernel, native, dim, values, named, place)
    if record_cmd:
        return recorded
    recorded.launch()
    return None


def _report(kernel, native, translating, launching) -> None:
    """Prints where the time of a launch that compiled something went.

    Args:
        translating, launching: seconds that the launch took to translate the function, and in all.
    """
    found = native.compile_times()
    known = vars(kernel).setdefault("_reported", {})
    if known.get(native) == found:
        return
    before = known.get(native, {})
    if len(known) >= 16:
        known.clear()
    known[native] = found
    times = {"translate": 1000.0 * translating}
    times |= {name: value - before.get(name, 0.0) for name, value in found.items()}
    # Parts of a phase are named below it.
    spent = sum(value for name, value in times.items() if "/" not in name)
    times["other"] = max(1000.0 * launching - spent, 0.0)
    times["in all"] = 1000.0 * launching
    shown = ", ".join(f"{name} {value:.1f}" for name, value in times.items())
    print(f"kernel '{kernel.key}': {shown} ms", file=sys.stderr)


def _sequence(values, kernel, what):
    if isinstance(values, (list, tuple)):
        return values
    if values is None:
        return ()
    raise errors.WarpLaunchTypeError(
        f"launch('{kernel.key}'): expects a list as '{what}', but got '{type(values).__name__}'"
    )


def _verify(kernel, native, values) -> None:
    """Rejects arrays that hold infinite numbers or NaN."""
    names = [parameter[0] for parameter in native.parameters]
    for name, value in zip(names, values, strict=True):
        if not isinstance(value, array):
            continue
        found = _not_finite(value.numpy())
        if found:
            raise errors.WarpLaunchError(
                f"launch('{kernel.key}'): array '{name}' has elements that are not finite, "
                f"the first is {found}"
            )


def _not_finite(numbers, path="") -> str:
    """The first number that is infinite or NaN, with its place; also in fields of structs."""
    import numpy

    if numbers.dtype.names:
        parts = (_not_finite(numbers[name], f"{path}.{name}") for name in numbers.dtype.names)
        return next(filter(None, parts), "")
    if numbers.dtype.kind != "f" or numpy.isfinite(numbers).all():
        return ""
    place = tuple(map(int, numpy.argwhere(~numpy.isfinite(numbers))[0]))
    return f"{numbers[place]} at {list(place)}{path}"


def _observe_recorded() -> None:
    """Recorded launches go the slow way while somebody observes, and cost nothing otherwise."""
    if Observers.active:
        Launch.launch = Launch._launch_observed
    elif "launch" in vars(Launch):
        del Launch.launch


Observers.on_change(_observe_recorded)


class LaunchBounds(typing.NamedTuple):
    """Extents of a grid of threads, their number, and the number of threads."""

    shape: tuple
    ndim: int
    size: int


class Launch(LaunchParameters, _native.PackedLaunch):
    """A launch with packed arguments, to be run many times.

    Made by `wp.launch(..., record_cmd=True)`, or without arguments by `wp.Launch(kernel, device)`:
    then parameters are zero, arrays None, and there are no threads, until they are set. Arguments
    are read when they are set, structs again at each launch.

    Args:
        kernel: a kernel without generic parameters.
        device: where to run.
        block_dim: CUDA threads per block.
        adjoint: make the launch of the derivative.

    Attributes:
        kernel: the kernel.
        device: where it runs.
        bounds: its grid: `shape`, `ndim`, `size`.
        block_dim: threads per block; 1 on a CPU, unless `config.enable_cpu_blocks` is set.
    """

    def __new__(cls, kernel, device=None, block_dim=0, adjoint=False):
        if not isinstance(kernel, Kernel):
            raise misfit("wp.Launch", "kernel", KERNEL, kernel)
        if not FLAG.fits(adjoint):
            raise misfit("wp.Launch", "adjoint", FLAG, adjoint)
        if kernel.is_generic:
            raise errors.WarpLaunchTypeError(
                f"Launch('{kernel.key}'): the kernel has generic parameters, record it with "
                "`wp.launch(..., record_cmd=True)`"
            )
        native, index = kernel.prepare(block_dim), resolve_index(device)
        threads = block_threads(kernel, index, block_dim)
        values = values_at_first(kernel)
        if kernel.hooks:
            # The extents are not known yet: blocks may lack threads.
            native, block_dim = kernel.place(native, 1, index, block_dim, values, True)
        if adjoint:
            return AdjointLaunch(kernel, native, 0, values, (), (index, None, block_dim))
        made = cls._packed(kernel, native, 0, values, (), index, None, block_dim)
        made.block_dim = threads
        return made

    @classmethod
    def _packed(cls, kernel, native, dim, inputs, outputs, index, stream, block_dim):
        made = super().__new__(cls, native, dim, inputs, outputs, index, stream, block_dim)
        made.kernel = kernel
        made.device = by_index(index)
        made._index = {parameter[0]: i for i, parameter in enumerate(native.parameters)}
        made._native = native
        made._place = (index, stream, block_dim)
        made._dim = dim
        made._values = [*inputs, *outputs]
        return made

    def __reduce__(self):
        raise TypeError(
            f"cannot pickle a launch of '{self.kernel.key}': send the kernel and its arguments, "
            "and record it where it is to run"
        )

    def _launch_observed(self, stream=None) -> None:
        """Takes the place of `launch` while somebody observes."""
        index, own, block_dim = self._place
        values = self._values
        call = Call(self.kernel, self._native, self._dim, values, index, stream or own, block_dim)
        if Observers.tape is not None or Observers.executor is not None:
            observed_launch(call)
            return
        Observers.memory.launching(call)
        _native.PackedLaunch.launch(self, stream)

    @property
    def bounds(self) -> LaunchBounds:
        """The grid of the launch."""
        dim = self._dim
        shape = tuple(dim) if isinstance(dim, (tuple, list)) else (dim,)
        return LaunchBounds(shape, len(shape), math.prod(shape))

    def set_dim(self, dim) -> None:
        """Changes the extents of the grid."""
        super().set_dim(dim)
        self._dim = dim

    def set_param(self, index, value) -> None:
        """Changes the value of a parameter by position.

        Raises:
            IndexError, TypeError: there is none at `index`.
        """
        try:
            super().set_param(index, value)
        except (IndexError, TypeError, OverflowError) as error:
            raise self._bad_index(error, "set_param", index) from None
        self._values[index] = value

    def set_param_bytes(self, index, value) -> None:
        """The same from a ctypes object with the bytes of the argument, or from a number.

        Raises:
            IndexError, TypeError: there is none at `index`.
        """
        try:
            super().set_param_bytes(index, value)
        except (IndexError, TypeError, OverflowError) as error:
            raise self._bad_index(error, "set_param_bytes", index) from None
        self._values[index] = getattr(value, "value", value)

    def _bad_index(self, error, method, index):
        if isinstance(error, IndexError):
            return errors.WarpIndexError(str(error))
        return explained(error, f"wp.Launch.{method}", index=(INTEGER, index))

    def set_params(self, values) -> None:
        """Changes the values of the first parameters.

        Raises:
            IndexError, TypeError: there are fewer, or `values` is no list.
        """
        try:
            super().set_params(values)
            self._values[: len(values)] = values
        except (IndexError, TypeError) as error:
            raise explained(error, "wp.Launch.set_params", values=(LIST, values)) from None

    def _flags(self, adjoint):
        if not FLAG.fits(adjoint):
            raise misfit("wp.Launch.set_param", "adjoint", FLAG, adjoint)
        if adjoint:
            raise errors.WarpLaunchError(
                f"launch('{self.kernel.key}'): the launch has no gradients, "
                f"record it with `adjoint=True`"
            )
        return ()
