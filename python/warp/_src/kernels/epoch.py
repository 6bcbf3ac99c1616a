"""When compiled code becomes stale."""

from warp._src import config as settings


class Epoch:
    """Identity of the settings that compiled code depends on; replaced when one changes."""

    current = object()

    @classmethod
    def advance(cls, value=None):
        cls.current = object()


for _name in (
    "mode",
    "fast_math",
    "lineinfo",
    "optimization_level",
    "max_unroll",
    "dump",
    "deterministic",
):
    settings.on_change(_name, Epoch.advance)
