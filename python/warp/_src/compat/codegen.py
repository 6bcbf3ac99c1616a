"""`warp._src.codegen`: the error classes, which packages catch under this name, and parameters of
kernels as Newton reads them (`kernel.adj.args`)."""

from __future__ import annotations

from types import SimpleNamespace

from warp._src.errors import WarpCodegenAttributeError as WarpCodegenAttributeError
from warp._src.errors import WarpCodegenError as WarpCodegenError
from warp._src.errors import WarpCodegenIndexError as WarpCodegenIndexError
from warp._src.errors import WarpCodegenKeyError as WarpCodegenKeyError
from warp._src.errors import WarpCodegenTypeError as WarpCodegenTypeError
from warp._src.errors import WarpCodegenValueError as WarpCodegenValueError
from warp._src.types.annotations import annotations_of
from warp._src.types.structs import StructInstance as StructInstance


def adjoint_of(kernel) -> SimpleNamespace:
    """A stand-in for the object that the peer generates code of: its parameters, each with `label`
    and `type`."""
    types = annotations_of(kernel.func)
    names = kernel.func.__code__.co_varnames[: kernel.func.__code__.co_argcount]
    return SimpleNamespace(
        args=[SimpleNamespace(label=name, type=types[name]) for name in names],
        fun_name=kernel.func.__name__,
    )
