"""`Kernel.schedule`: what the compiler and the runtime decided about launches, as text."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from warp import _native
from warp._src.devices.devices import get_device


@dataclasses.dataclass(frozen=True)
class Choice:
    """A decision: `what` it is about, its `value`, the `reason`, and the source line or 0."""

    what: str
    value: str
    reason: str
    line: int = 0

    def __str__(self):
        place = f" (line {self.line})" if self.line else ""
        return f"{self.what:<18}{self.value}: {self.reason}{place}"


@dataclasses.dataclass(frozen=True)
class Schedule:
    """How one kind of launch is made.

    Attributes:
        kernel: name of the kernel.
        launch: what tells this kind of launch from others.
        choices: the decisions, those of passes in their order first.
        facts: the facts of the launch that the compiler decided, by their names in
            docs/launch.md; empty for code without source.
    """

    kernel: str
    launch: str
    choices: tuple[Choice, ...]
    facts: Mapping[str, bool | int | float] = dataclasses.field(default_factory=dict, hash=False)

    def __getitem__(self, what: str) -> str:
        """The value of the first decision about something.

        Raises:
            KeyError: there is none.
        """
        for choice in self.choices:
            if choice.what == what:
                return choice.value
        raise KeyError(what)

    def __contains__(self, what: str) -> bool:
        return any(choice.what == what for choice in self.choices)

    def __str__(self):
        lines = [f"{self.kernel}: {self.launch}"]
        return "\n  ".join(lines + [str(choice) for choice in self.choices])


class Schedules(tuple):
    """Several schedules, printed one below the other."""

    __slots__ = ()

    def __str__(self):
        return "\n".join(map(str, self))


def schedules_of(kernel, device, dim, arch) -> Schedules:
    """The schedules of a kernel's launches; see `Kernel.schedule`."""
    if kernel.is_generic:
        raise RuntimeError(f"kernel '{kernel.key}' is generic, its types are open")
    if arch is not None and arch not in _native.gpu_architectures():
        raise ValueError(f"there is no schedule for architecture {arch!r}")
    index = -1
    if arch is None:
        place = get_device(device)
        index, arch = (-1 if place.is_cpu else place.index), place.arch
    arch = arch or 0
    native = kernel.prepare()
    if dim is None and index >= 0:
        natives = kernel.launched_on(native, arch)
    else:
        natives = [kernel.code_for(native, arch)]
    return Schedules(
        Schedule(kernel.key, launch, tuple(Choice(*choice) for choice in choices), facts)
        for one in natives
        for launch, choices, facts in one.schedules(index, arch, dim)
    )
