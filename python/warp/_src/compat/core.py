"""The peer's C functions that public packages call, under the names that these use.

Newton calls builtins of Python scope past the choice of an overload (`_src/core/host_transform.py`)
and, in its cloth solver, sums of products by address. Here both are what the package does anyway.
"""

from __future__ import annotations

import ctypes
import functools

from warp._src.builtin_table import BUILTINS, LIBRARY

_BUILTIN = "wp_builtin_"
_SUMS = {"wp_array_inner_float": "float32", "wp_array_inner_double": "float64"}


class Core:
    """Functions by name.

    The switch of what native code prints is there, because tests turn it off: nothing is printed.
    """

    def __init__(self):
        self._prints_errors = True

    def wp_is_error_output_enabled(self) -> bool:
        return self._prints_errors

    def wp_set_error_output_enabled(self, enabled) -> None:
        self._prints_errors = bool(enabled)

    @staticmethod
    def wp_is_mathdx_enabled() -> bool:
        """Asked by tests whether tiles are multiplied, factored and transformed by MathDx."""
        return False

    def __getattr__(self, name):
        found = _builtin(name) if name.startswith(_BUILTIN) else _inner(name)
        if found is None:
            raise AttributeError(
                f"there is no native function '{name}', the functions of this package are called "
                "by their public names in `warp`"
            )
        self.__dict__[name] = found
        return found


def _builtin(name):
    """`wp_builtin_NAME_TYPES(arguments..., pointer to the result)`."""
    import warp

    words = name.removeprefix(_BUILTIN).split("_")
    for count in range(len(words), 0, -1):
        key = "_".join(words[:count])
        if key in BUILTINS or key in LIBRARY:
            return functools.partial(_call, getattr(warp, key))
    return None


def _call(function, *arguments) -> None:
    *values, result = arguments
    found = function(*(value.value if _is_number(value) else value for value in values))
    target = getattr(result, "_obj", None)
    if target is None:
        target = result.contents
    if _is_number(target):
        target.value = getattr(found, "value", found)
    else:
        ctypes.memmove(ctypes.addressof(target), ctypes.addressof(found), ctypes.sizeof(target))


def _is_number(value) -> bool:
    return isinstance(value, ctypes._SimpleCData)


def _inner(name):
    """`wp_array_inner_float_host(a, b, out, count, stride of a, stride of b, length of elements)`,
    with addresses and strides in bytes."""
    kind, _, place = name.rpartition("_")
    if kind not in _SUMS or place not in ("host", "device"):
        return None

    def inner(a, b, out, count, stride_a, stride_b, length):
        import warp

        scalar = getattr(warp, _SUMS[kind])
        device = "cpu" if place == "host" else warp.get_cuda_device()

        def operand(address, stride):
            pitch = warp.types.type_size_in_bytes(scalar)
            return warp.array(
                ptr=address,
                dtype=scalar,
                shape=(count, length),
                strides=(stride, pitch),
                device=device,
            )

        total = warp.array(ptr=out, dtype=scalar, shape=(1,), device=device)
        warp.utils.array_inner(operand(a, stride_a), operand(b, stride_b), out=total)

    return inner
