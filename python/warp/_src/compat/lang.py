"""`warp._src.lang`: functions written in the kernel language, which Newton names."""

from warp._src.language.public import find


def __getattr__(name):
    return find(name)
