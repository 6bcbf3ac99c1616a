"""Functions and kernels made once - decorators for definitions in functions of Python.

A definition inside of a function runs again with each call. These decorators give the first result
again for the same suffix, so that code is translated once.
"""

from __future__ import annotations

import hashlib

import warp as wp

_made: dict = {}


def _types(func) -> tuple:
    return tuple((name, repr(t)) for name, t in func.__annotations__.items())


def _key(func, suffix, *more) -> tuple:
    return func.__module__, func.__qualname__, suffix, *more


def _name(func, key) -> str:
    return f"{func.__name__}_{hashlib.blake2b(repr(key).encode(), digest_size=4).hexdigest()}"


def dynamic_func(suffix, code_transformers=None, allow_overloads=False):
    """Decorator: the function of kernels that was made first for a suffix.

    Args:
        suffix: hashable; tells definitions of one place apart.
        code_transformers: see `wp.Function`.
        allow_overloads: definitions with other types are overloads of one function.

    Example:
        >>> import warp as wp
        >>> from warp import fem
        >>> def scale_by(factor):
        ...     @fem.cache.dynamic_func(suffix=factor)
        ...     def scale(x: float):
        ...         return factor * x
        ...     return scale
        >>> scale_by(2.0) is scale_by(2.0)
        True
    """

    def decorate(func):
        key = _key(func, suffix)
        made = _made.get(key)
        types = _types(func)
        if made is None:
            function = wp.Function(func, key=_name(func, key), code_transformers=code_transformers)
            _made[key] = function, {types}
            return function
        function, known = made
        if allow_overloads and types not in known:
            known.add(types)
            function.add_overload(wp.Function(func, code_transformers=code_transformers).func)
        return function

    return decorate


def dynamic_kernel(suffix, kernel_options=None, allow_overloads=False):
    """Decorator: the kernel that was made first for a suffix and options.

    Args:
        suffix: hashable; tells definitions of one place apart.
        kernel_options: options of the kernel.
        allow_overloads: definitions with other types are kernels of their own.
    """
    options = dict(kernel_options or {})

    def decorate(func):
        key = _key(func, suffix, tuple(sorted(options.items())))
        if allow_overloads:
            key = *key, _types(func)
        if key not in _made:
            _made[key] = wp.Kernel(func, key=_name(func, key), options=options)
        return _made[key]

    return decorate
