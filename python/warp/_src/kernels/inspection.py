"""Questions of libraries about functions: syntax, types of variables, remembered results."""

from __future__ import annotations

import marshal
import os


def syntax_of(function):
    """The syntax tree of a Python function, an `ast.FunctionDef`; positions are those in the block
    of its text.

    Example:
        >>> from warp import extend
        >>> text = "def twice(x: float):\\n    return 2.0 * x\\n"
        >>> extend.syntax_of(extend.function_from_text(text)).name
        'twice'
    """
    from warp._src.frontend.source import source_of

    return source_of(function).tree


def place_of(function, node) -> dict:
    """File, line and columns of a node of `syntax_of(function)`, as arguments of a `WarpError`.

    Example:
        >>> from warp import extend
        >>> text = "def twice(x: float):\\n    return 2.0 * x\\n"
        >>> function = extend.function_from_text(text)
        >>> extend.place_of(function, extend.syntax_of(function).body[0])["line"]
        2
    """
    from warp._src.frontend.source import source_of

    return source_of(function).place(node)


def type_of_local(function, name: str):
    """The type of a variable of a kernel at its end, without compiling it.

    Args:
        function: a Python function, as for `wp.kernel`.

    Raises:
        WarpCodegenError: the function cannot be translated, or the variable holds no value.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> text = "def kernel(x: wp.vec3):\\n    y = wp.length(x)\\n"
        >>> extend.type_of_local(extend.function_from_text(text, {"wp": wp}), "y").__name__
        'float32'
    """
    from warp._src.frontend.build import types_of_local
    from warp._src.types.dtypes import dtype_of

    return dtype_of(types_of_local(function, function.__name__, name)[0])


def remembered(value, make, is_good=bool):
    """The result of `make()`, from another process if the kernel cache has it.

    Args:
        value: what the result depends on, beside this package: numbers, types, functions of
            kernels, tuples and frozen dataclasses. Other values have no name that lasts, and the
            result is made anew.
        make: gives numbers, strings, tuples, lists, sets or dictionaries of these.
        is_good: tells a result from what is no longer one.

    Example:
        >>> from warp import extend
        >>> extend.remembered(("squares", 3), lambda: [k * k for k in range(3)])
        [0, 1, 4]
    """
    path = _path(value)
    if path is None:
        return make()
    try:
        with open(path, "rb") as file:
            found = marshal.loads(file.read())
        if is_good(found):
            return found
    except (OSError, EOFError, ValueError, TypeError):
        pass
    made = make()
    try:
        temporary = f"{path}.{os.getpid()}"
        with open(temporary, "wb") as file:
            file.write(marshal.dumps(made))
        os.replace(temporary, path)
    except (OSError, ValueError):
        # The cache is full or read-only, or a result has other values.
        pass
    return made


def _path(value) -> str | None:
    from warp import config
    from warp._src.kernels import identity

    if not config.cache_kernels or not config.kernel_cache_dir:
        return None
    found = identity.Identity()
    try:
        found.add((identity._installation(), value))
        digest = found.digest()
    except Exception:
        return None
    if any(found.unnamed) or found.unnamed_attributes:
        return None
    return os.path.join(config.kernel_cache_dir, f"{digest}.facts")


def forget() -> None:
    """Removes remembered results from disk."""
    from warp import config

    folder = config.kernel_cache_dir
    if not folder or not os.path.isdir(folder):
        return
    for entry in os.scandir(folder):
        if entry.name.endswith(".facts"):
            os.unlink(entry.path)
