"""Parameters of launches that are made later, by position and by name."""

from __future__ import annotations

from warp._src import errors
from warp._src.argument_kinds import LIST, TEXT
from warp._src.arguments import checked, misfit
from warp._src.types import annotations, dtypes


def values_at_first(kernel) -> list:
    """Zeros for the parameters of a kernel, None for arrays.

    A transform is all zero as well, which `t()` is not.
    """
    found = annotations.annotations_of(kernel.func)
    names = kernel.func.__code__.co_varnames[: kernel.func.__code__.co_argcount]
    types = [annotations.resolve(found[name]) for name in names]
    # Whatever is no number and no composite of them is an array of some kind.
    whole = [dtypes.type_is_value(t) or dtypes.is_struct(t) for t in types]
    return [_zero_of(t) if one else None for t, one in zip(types, whole, strict=True)]


def _zero_of(dtype):
    return dtype(0.0) if dtypes.type_is_transformation(dtype) else dtype()


class LaunchParameters:
    """Names of the parameters of a launch to be run later."""

    def _position(self, name) -> int:
        if not isinstance(name, str):
            raise misfit("wp.Launch.set_param_by_name", "name", TEXT, name)
        if name not in self._index:
            raise errors.WarpLaunchValueError(
                f"kernel '{self.kernel.key}' has no parameter '{name}', it has: "
                + ", ".join(self._index)
            )
        return self._index[name]

    def set_param_at_index(self, index, value, adjoint=False) -> None:
        """Changes the value of a parameter by position, or with `adjoint` its gradient."""
        self.set_param(index, value, *self._flags(adjoint))

    def set_param_at_index_from_ctype(self, index, value, adjoint=False) -> None:
        """The same from a ctypes object with the bytes of the argument, or from a number."""
        self.set_param_bytes(index, value, *self._flags(adjoint))

    def set_param_by_name(self, name, value, adjoint=False) -> None:
        """Changes the value of a parameter by name, or with `adjoint` its gradient."""
        self.set_param(self._position(name), value, *self._flags(adjoint))

    def set_param_by_name_from_ctype(self, name, value, adjoint=False) -> None:
        """The same from a ctypes object with the bytes of the argument, or from a number."""
        self.set_param_bytes(self._position(name), value, *self._flags(adjoint))

    @checked(values=LIST)
    def set_params_from_ctypes(self, values) -> None:
        """Changes the values of the first parameters from ctypes objects and numbers."""
        for index, value in enumerate(values):
            self.set_param_bytes(index, value)

    def _flags(self, adjoint):
        return (True,) if adjoint else ()
