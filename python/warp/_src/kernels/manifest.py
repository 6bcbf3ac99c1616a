"""`wp.manifest`: what the kernels of this process use, and what they carry without using it."""

from __future__ import annotations

import collections
import dataclasses
import re
import types

from warp._src.argument_kinds import FLAG, INTEGER, MODULE
from warp._src.arguments import checked
from warp._src.kernels import modules

_OPERATION = re.compile(r'(?:= |^ +)"?((?:warp|scf|arith|math)\.\w+)"?(?: "(\w+)")?', re.MULTILINE)
_BODY = re.compile(r"func\.func .*?^  }", re.MULTILINE | re.DOTALL)
# Instructions of an assembler's text: no labels, directives or comments.
_INSTRUCTION = re.compile(r"^\t(?![.#/])\s*[a-z@]", re.MULTILINE)


@dataclasses.dataclass(frozen=True)
class KernelManifest:
    """The features that one piece of native code uses.

    Attributes:
        kernel: its name.
        module: name of the Python module.
        variant: `forward`, `constants` (for one set of launch constants), `adjoint` or `tangent`.
        operations: how often each operation of the kernel language occurs.
        library: functions of the device library that are linked.
        launches: kinds of launches that code was made for.
        unused: parameters, and fields of structs, that are never read or written.
        milliseconds: spent on compiling it in this process.
        instructions: of the processor, or of PTX; None unless it was asked for.
    """

    kernel: str
    module: str
    variant: str
    operations: dict[str, int]
    library: tuple[str, ...]
    launches: tuple[str, ...]
    unused: tuple[str, ...]
    milliseconds: float
    instructions: int | None = None


class Manifest(tuple):
    """The `KernelManifest`s of a process; `print` shows a table."""

    @property
    def library(self) -> set[str]:
        """Functions of the device library that any kernel links."""
        return {name for entry in self for name in entry.library}

    @property
    def unused(self) -> list[str]:
        """The present but unused parts, a line each; none in a lean program."""
        return [
            f"kernel '{entry.kernel}': {what}"
            for entry in self
            if entry.variant == "forward"
            for what in entry.unused
        ]

    def as_dicts(self) -> list[dict]:
        """The lines as dictionaries, for JSON."""
        return [dataclasses.asdict(entry) for entry in self]

    def __str__(self):
        rows = [("kernel", "variant", "launches", "operations", "library", "ms", "instructions")]
        for one in self:
            count = "" if one.instructions is None else str(one.instructions)
            numbers = str(len(one.launches)), str(sum(one.operations.values()))
            last = ", ".join(one.library) or "-", f"{one.milliseconds:.1f}", count
            rows.append((one.kernel, one.variant, *numbers, *last))
        widths = [max(map(len, column)) for column in zip(*rows)]
        lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
        return "\n".join([*lines, *(f"unused: {line}" for line in self.unused)])


@checked(code=FLAG, arch=INTEGER, module=MODULE)
def manifest(
    code: bool = False, arch: int | None = None, module: str | types.ModuleType | None = None
) -> Manifest:
    """The features that the kernels translated in this process use.

    Kernels that were only declared cost nothing and are not listed.

    Args:
        code: count instructions, too; each kernel is compiled again for that.
        arch: of PTX for this architecture, `90` for `sm_90`, in place of the CPU's.
        module: only kernels that this Python module declares; its name will do.

    Returns:
        A tuple with an entry for each kernel, each of its specializations, and each derivative
        that was made.

    Example:
        >>> print(wp.manifest())  # doctest: +SKIP
        kernel  variant  launches  operations  library  ms    instructions
        scale   forward  1         6           -        12.1
    """
    wanted = getattr(module, "__name__", module)
    return Manifest(
        _entry(one, kernel, variant, native, code, arch)
        for one in modules.all_modules()
        if wanted in (None, one.name)
        for kernel in one.kernels.values()
        for variant, native in _natives(kernel)
    )


def _natives(kernel):
    """Native kernels that were made so far, by what they compute."""
    if kernel.native is not None:
        yield "forward", kernel.native
    for native in kernel.specializations:
        yield "forward", native
    for one in getattr(kernel, "constant_sets", ()):
        if one.native is not None:
            yield "constants", one.native
    derivatives = kernel.__dict__.get("derivatives")
    for mode, native in derivatives.made() if derivatives else ():
        yield mode, native


def _entry(module, kernel, variant, native, code, arch):
    text, times = native.ir("warp"), native.compile_times()
    # The entry is the last function; those that it calls stand before it.
    bodies = _BODY.findall(text)
    operations = collections.Counter(name for name, _ in _OPERATION.findall(text))
    library = {name for op, name in _OPERATION.findall(text) if op == "warp.library_call"}
    count = None
    if code:
        stage = "ptx" if arch else "asm"
        count = len(_INSTRUCTION.findall(native.ir(stage, arch or 0)))
    return KernelManifest(
        kernel=kernel.key,
        module=module.name,
        variant=variant,
        operations=dict(operations),
        library=tuple(sorted(library)),
        launches=tuple(what for what, *_ in native.schedules()) if times else (),
        unused=tuple(_unused(native, bodies[-1] if bodies else "", text)),
        milliseconds=times.get("compile", 0.0),
        instructions=count,
    )


def _unused(native, body, text):
    """Parameters without a use in the entry, and fields of structs that nothing names."""
    _, _, rest = body.partition("\n")
    for number, parameter in enumerate(native.parameters):
        if not re.search(rf"%arg{number}\b", rest):
            yield f"parameter '{parameter[0]}' is never used"
    for name, fields in re.findall(r'!warp\.struct<"(\w+)", {(.*?)}>', text.split("\n", 1)[0]):
        for field in re.findall(r"(\w+): ", fields):
            if f'["{field}"]' not in text:
                yield f"field '{field}' of struct '{name}' is never used"
