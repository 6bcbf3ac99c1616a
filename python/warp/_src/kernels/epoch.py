"""When compiled code becomes stale."""

import typing

from warp import config
from warp._src import config as settings

_NAMES = (
    "mode",
    "fast_math",
    "lineinfo",
    "optimization_level",
    "max_unroll",
    "inline_budget",
    "dump",
    "deterministic",
    "ordered_slots",
    "peer_tile_gradients",
)


def _values() -> tuple:
    return tuple([getattr(config, name) for name in _NAMES])


class Epoch:
    """Identity of the settings that compiled code depends on; the same ones have the same again."""

    current = object()
    _known: typing.ClassVar[dict] = {_values(): current}

    @classmethod
    def advance(cls) -> None:
        """Makes all compiled code stale."""
        cls.current = object()
        cls._known = {_values(): cls.current}

    @classmethod
    def settle(cls, value=None) -> None:
        """Finds the epoch of the settings as they are now."""
        cls.current = cls._known.setdefault(_values(), object())


for _name in _NAMES:
    settings.on_change(_name, Epoch.settle)
