"""Types of kernels: scalars, vectors, matrices, structs, and annotations of parameters."""


def __getattr__(name):
    """Names that other packages know under `warp._src.types`."""
    if name.startswith("__"):
        raise AttributeError(name)
    import importlib
    import os

    try:
        names = importlib.import_module("warp._src.type_names")
    except ModuleNotFoundError:
        # `__init__.py` of NVIDIA Warp lies over ours: it takes this package for its `types.py`.
        from warp._src import beside

        beside.check(os.path.dirname(os.path.dirname(__path__[0])), covered=True)
        raise
    return getattr(names, name)
