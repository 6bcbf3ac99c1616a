"""The front end: Python functions become modules of the warp dialect.

How a kernel goes through it:

    source      text and syntax tree of the function, without `inspect`
    control     break, continue and return become flags; which names are live where
    statements  the translator, put together from one class per topic:
                emitter (bindings, constants, errors) < indexed < access < expressions < branches
                < loops < targets (assignment) < user_calls < references < derivatives
                < constructors < output < calls
    names       what a free name refers to
    functions   parameters and overloads of `@wp.func`

The translator calls the native builder, which has all type rules. Translation is deterministic: the
text of the module keys the kernel cache.
"""

from __future__ import annotations

from warp._src.frontend.build import build_kernel

__all__ = ["build_kernel"]
