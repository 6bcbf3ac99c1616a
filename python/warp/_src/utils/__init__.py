"""The functions of `warp.utils`, by topic."""


def __getattr__(name):
    """Names that other packages know under `warp._src.utils`."""
    if name.startswith("__"):
        raise AttributeError(name)
    import importlib

    return getattr(importlib.import_module("warp._src.utility_names"), name)
