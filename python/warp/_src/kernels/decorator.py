"""`@wp.kernel`: makes a kernel from a function."""

from __future__ import annotations

import re
import types as python_types
import typing
from collections.abc import Callable

from warp._src.arguments import shown
from warp._src.kernels import unique
from warp._src.kernels.function import function_of_source
from warp._src.kernels.kernel import Kernel
from warp._src.kernels.kernel_options import (
    check_constants,
    check_launch_bounds,
    check_registers,
    inert_options,
)
from warp._src.kernels.modules import Module, check_options


@typing.overload
def kernel(f: Callable[..., typing.Any]) -> Kernel: ...


@typing.overload
def kernel(
    f: None = None,
    *,
    name: str | None = None,
    enable_backward: bool | None = None,
    launch_bounds: typing.Any = None,
    cuda_max_registers: int | None = None,
    launch_constants: typing.Any = None,
    module: typing.Any = None,
    module_options: dict[str, typing.Any] | None = None,
    source: str,
    **options: typing.Any,
) -> Kernel: ...


@typing.overload
def kernel(
    f: None = None,
    *,
    name: str | None = None,
    enable_backward: bool | None = None,
    launch_bounds: typing.Any = None,
    cuda_max_registers: int | None = None,
    launch_constants: typing.Any = None,
    module: typing.Any = None,
    module_options: dict[str, typing.Any] | None = None,
    **options: typing.Any,
) -> Callable[[Callable[..., typing.Any]], Kernel]: ...


def kernel(
    f=None,
    *,
    name=None,
    enable_backward=None,
    launch_bounds=None,
    cuda_max_registers=None,
    launch_constants=None,
    module=None,
    module_options=None,
    source=None,
    **options,
):
    """Makes a kernel from a function whose parameters are annotated.

    Args:
        name: name in messages and compiled code, by default that of the function.
        enable_backward: False if no derivatives will be asked for.
        launch_bounds: largest block, and fewest blocks per multiprocessor, for CUDA; a launch with
            a larger block is an error.
        cuda_max_registers: registers that a CUDA thread may use; not together with `launch_bounds`.
        launch_constants: names of parameters (`"order"`), or of fields of structs
            (`"settings.contact"`), whose values many launches share: the first 8 sets of values get
            code of their own where it differs.
        module: module whose options apply, by default that of the function. "unique" makes one for
            this kernel; a second definition of the same text, captures and options gives the first
            kernel again.
        module_options: options for this kernel alone.
        source: text of the function, one `def` without decorators; gives the kernel and no
            decorator. Names in it mean what they mean where `wp.kernel` is called.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def scale(x: wp.array(dtype=float), s: float):
        ...     i = wp.tid()
        ...     x[i] = x[i] * s

        From text that no file has:

        >>> fill = wp.kernel(source="def fill(x: wp.array(dtype=float)): x[wp.tid()] = 2.0")
        >>> x = wp.zeros(2, dtype=float, device="cpu")
        >>> wp.launch(fill, 2, [x], device="cpu")
        >>> print(x)
        [2. 2.]

    Raises:
        TypeError: what is decorated is no function, or an option has the wrong type.
        ValueError: an option has no such value, two exclude each other, or `source` is not one
            `def` without decorators.
    """
    if source is not None:
        f = function_of_source("kernel", f, source)
    if not (module is None or isinstance(module, (str, Module, python_types.ModuleType))):
        raise TypeError(f"kernel module must be a module or its name, but got {shown(module)}")
    own = {} if module_options is None else module_options
    check_options(own)
    own, own_module = ({}, own) if module == "unique" else (dict(own), None)
    if enable_backward is not None:
        own["enable_backward"] = enable_backward
    if launch_bounds is not None:
        if cuda_max_registers is not None:
            raise ValueError("cuda_max_registers and launch_bounds exclude each other")
        own["launch_bounds"] = check_launch_bounds(launch_bounds)
    if cuda_max_registers is not None:
        own["cuda_max_registers"] = check_registers(cuda_max_registers)
    if launch_constants is not None:
        own["launch_constants"] = check_constants(launch_constants)
    own |= inert_options(options, enable_backward)
    if name is not None and not isinstance(name, str):
        raise TypeError(f"kernel name must be a string, but got {shown(name)}")
    if name is not None and not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ValueError(f"kernel name must be a valid C++ identifier, but got {name!r}")

    def decorate(func):
        if module == "unique" and isinstance(func, python_types.FunctionType):
            return unique.unique(Kernel, func, name, own, own_module)
        return Kernel(func, name, None if module == "unique" else module, own)

    return decorate if f is None else decorate(f)
