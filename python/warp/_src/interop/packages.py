"""Packages that arrays are exchanged with, or a message that says how to install them."""

import functools
import importlib

from warp._src import errors

# Names are written out for what reads imports, such as the test of cycles.
_PACKAGES = {
    "torch": ("PyTorch", lambda rest: importlib.import_module(f"torch{rest}")),
    "jax": ("JAX", lambda rest: importlib.import_module(f"jax{rest}")),
}


@functools.cache
def load(name):
    """The package of a module, which is imported too: `load("jax.numpy")` is `jax`.

    Raises:
        ImportError: it is not installed.
    """
    package, dot, rest = name.partition(".")
    title, find = _PACKAGES[package]
    try:
        found = find("")
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        purpose, extra = f"exchange with {title}", f'"warp-mlir[{package}]"'
        raise errors.absent(package, purpose, extra) from error
    find(dot + rest)
    return found
