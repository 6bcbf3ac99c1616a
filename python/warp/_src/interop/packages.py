"""Packages that arrays are exchanged with, or a message that says how to install them."""

import functools
import importlib

_EXTRAS = {"torch": "PyTorch", "jax": "JAX"}


@functools.cache
def load(name):
    """The package of a module, which is imported too: `load("jax.numpy")` is `jax`.

    Raises:
        ImportError: it is not installed.
    """
    package = name.partition(".")[0]
    try:
        found = importlib.import_module(package)
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        raise ImportError(
            f"exchange with {_EXTRAS[package]} needs the package '{package}': "
            f'pip install "warp-mlir[{package}]"',
            name=package,
        ) from error
    importlib.import_module(name)
    return found
