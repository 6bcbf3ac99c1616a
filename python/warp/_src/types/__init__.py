"""Types of kernels: scalars, vectors, matrices, structs, and annotations of parameters."""


def __getattr__(name):
    """Names that other packages know under `warp._src.types`."""
    if name.startswith("__"):
        raise AttributeError(name)
    import importlib

    return getattr(importlib.import_module("warp._src.type_names"), name)
