"""Adjoints in modules that are compiled ahead of time.

The adjoint of a kernel depends on which of its arrays have a gradient, so a file has one for each
such set. It is saved like any kernel, as `<kernel>.adjoint.<set>`, a digit for each array among
the parameters; `<kernel>.augmented.<set>` is the forward launch that keeps what it needs,
`<kernel>.counting.<set>` the one that finds how much memory its loops need,
`<kernel>.sizing.<set>` and `<kernel>.recording.<set>` run again what overwrites what its loops
read, and
`<kernel>.sums.<set>` with `<kernel>.rest.<set>` are the parts of an adjoint that gathers. A program
that has loaded the file still derives the adjoint from the kernel's source, which takes a few
milliseconds and says whether the saved code is that of today's source; it compiles nothing.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors


def saved_name(name: str, part: str, active) -> str:
    """Name of a derivative's code; `part` is one of `parts`."""
    return f"{name}.{part}.{''.join('1' if one else '0' for one in active)}"


def parts(derivative) -> dict:
    """Native kernels that a derivative is made of."""
    found = {
        "adjoint": derivative.native,
        "augmented": derivative.augmented,
        "counting": derivative.counting,
        "sizing": derivative.sizing,
        "recording": derivative.recording,
    }
    if derivative.gathered is not None:
        found |= {"sums": derivative.gathered.sums, "rest": derivative.gathered.rest}
    return {part: native for part, native in found.items() if native is not None}


def wants_adjoints(kernel, enable_backward) -> bool:
    """True if the adjoints of a kernel are to be saved.

    Args:
        enable_backward: what the caller asked for; None leaves it to the option of that name if
            the kernel or its module has set it.
    """
    if not kernel.option("enable_backward"):
        return False
    if enable_backward is not None:
        return enable_backward
    return "enable_backward" in kernel.options or "enable_backward" in kernel.module.options


def adjoints(kernel, native, name, wanted=None) -> list:
    """The derivatives of a native kernel to save, as pairs of a native kernel and its name.

    Args:
        name: that of the kernel in the file.
        wanted: sets of names of arrays that have a gradient; None stands for all floating-point
            arrays, if that has a derivative, and for the sets that backward passes have used.

    Raises:
        ValueError: there is no such array.
        WarpCodegenError: a set that was asked for has no derivative.
    """
    leaves = _leaves(native.parameters)
    if wanted is None:
        sets = [tuple(real for _, real in leaves), *kernel.derivatives.active_sets(native)]
    else:
        sets = [_set(kernel, leaves, names) for names in wanted]
    pairs = []
    for active in dict.fromkeys(one for one in sets if any(one)):
        try:
            made = kernel.derivatives.adjoint(native, active)
        except errors.WarpError:
            if wanted is None:
                continue
            raise
        pairs += [(one, saved_name(name, part, active)) for part, one in parts(made).items()]
    return pairs


def _set(kernel, leaves, names) -> tuple:
    known = [leaf for leaf, real in leaves if real]
    for name in names:
        if name not in known:
            raise ValueError(
                f"kernel '{kernel.key}' has no floating-point array '{name}', it has: "
                f"{', '.join(known)}"
            )
    return tuple(leaf in names for leaf, _ in leaves)


def _leaves(parameters) -> list[tuple[str, bool]]:
    """Name of each array among the parameters, and whether its elements have derivatives."""
    found: list = []
    for parameter in parameters:
        found += _arrays_in(parameter[0], _native.Type.parse(parameter[2]))
    return found


def _arrays_in(name, native) -> list[tuple[str, bool]]:
    if native.kind == "array":
        return [(name, _is_real(native.element))]
    fields = native.fields if native.kind == "struct" else ()
    return [one for field, kind in fields for one in _arrays_in(f"{name}.{field}", kind)]


def _is_real(native) -> bool:
    if native.kind == "struct":
        return any(kind.kind != "array" and _is_real(kind) for _, kind in native.fields)
    return (native.element or native).kind == "float"
