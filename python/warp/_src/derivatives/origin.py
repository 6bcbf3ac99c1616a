"""Finds the operation in an adjoint kernel where a gradient stops being finite.

The adjoint is compiled again with notes: first each gradient that a thread writes is looked at, and
a thread that writes a bad one leaves its number; then that thread alone writes down the value of
every operation, until it writes the bad gradient. From there the notes are followed backwards,
through values that are not finite, to the operation that made one of finite operands.

Works on the text of the module. Values of vectors are noted as finite or not, those of other
composites not at all.
"""

from __future__ import annotations

import math
import re
import typing

import numpy

from warp import _native
from warp._src.arrays.create import zeros
from warp._src.devices.devices import by_index
from warp._src.types.scalars import float64

_OPERATION = re.compile(r"^\s*(?:%(\w+)(?::\d+)? = )?([\w.]+)(.*)$")
_LOCATION = re.compile(r"loc\((#loc\d*)\)\s*$")
_PLACE = re.compile(r'^(#loc\d*) = loc\(.*?"([^"]*)":(\d+):(\d+)')
_RESULT = re.compile(r"-> (f32|f64|!warp\.vec<\d+ x f(?:32|64)>) loc\(")
_WRITTEN = re.compile(r"^\s*warp\.(?:accumulate|store) %(\w+), .*? : (f32|f64|!warp\.vec<[^>]*>),")
_EXTRA = ("san", "san_d1", "san_d2", "san_d3", "san_target")


class Origin(typing.NamedTuple):
    """An operation that made a number that is not finite.

    Attributes:
        operation: its name.
        operands: values of its scalar operands, None where they are not known.
        file, line, column: the place in the kernel's source.
    """

    operation: str
    operands: list
    file: str
    line: int
    column: int


def find_origin(made, call, values, restore) -> Origin | None:
    """The operation that the first bad gradient of an adjoint's launch comes from.

    Args:
        made: the derivative.
        call: the launch.
        values: arguments of the adjoint, hidden ones included.
        restore: called before each run; brings the gradients back.
    """
    text = made.module.text(True)
    threads = _run(made, call, values, restore, _Notes(text, False), -1)
    if not threads[1]:
        return None
    notes = _Notes(text, True)
    return notes.follow(_run(made, call, values, restore, notes, int(threads[1]) - 1))


def _run(made, call, values, restore, notes, target) -> numpy.ndarray:
    native = made.kernel.compile_module(_native.Module.from_text(notes.text))
    dim = call.dim if isinstance(call.dim, (tuple, list)) else (call.dim,)
    extents = [*dim, 1, 1, 1, 1][1:4]
    board = zeros(len(notes.lines) + 2, float64, by_index(call.device))
    restore()
    native.launch(
        call.dim, values, (board, *extents, target), call.device, None, call.block_dim or 0
    )
    return board.numpy().copy()


class _Notes:
    """The text of a module with notes, and what it says about each operation.

    Args:
        everything: note all operations of one thread, else which thread writes a bad gradient.
    """

    def __init__(self, text: str, everything: bool):
        self.lines = text.splitlines()
        self.places = {
            match[1]: (match[2], int(match[3]), int(match[4]))
            for match in map(_PLACE.match, self.lines)
            if match
        }
        # By number of the line: operation, location, operands as numbers of lines.
        self.operations: dict[int, tuple[str, str, list[int]]] = {}
        self.written: dict[int, int] = {}
        self._scopes: list[dict[str, int]] = [{}]
        self._owners: list[int] = []
        self._next = 0
        self.text = "\n".join(self._annotate(everything))

    def _annotate(self, everything) -> list[str]:
        output: list[str] = []
        for number, line in enumerate(self.lines):
            if "func.func" in line:
                output += [_with_parameters(line), *_prologue()]
                continue
            before, after = self._visit(number, line, everything)
            output += [*before, line, *after]
        return output

    def _visit(self, number, line, everything) -> tuple[list[str], list[str]]:
        """Enters an operation into the tables; lines to put before and after it."""
        stripped = line.strip()
        if stripped.startswith("}") and self._owners:
            self._scopes.pop()
            owner = self._owners.pop()
            if "{" in stripped:
                self._owners.append(owner)
                self._scopes.append(dict(self._scopes[-1]))
            return [], []
        match = _OPERATION.match(line)
        if not match or (
            len(self._scopes) == 1 and not stripped.startswith(("%", "warp.", "scf."))
        ):
            return [], []
        name, operation, rest = match.groups()
        operands = [
            self._scopes[-1][one] for one in re.findall(r"%(\w+)", rest) if one in self._scopes[-1]
        ]
        location = _LOCATION.search(line)
        self.operations[number] = (operation, location[1] if location else "", operands)
        if name:
            self._scopes[-1][name] = number
        if operation in ("scf.yield", "scf.condition") and self._owners:
            self.operations[self._owners[-1]][2].extend(operands)
        if stripped.endswith("{") or stripped.endswith("do {"):
            self._owners.append(number)
            self._scopes.append(dict(self._scopes[-1]))
            for carried in re.findall(r"%(arg\d+) =", rest):
                self._scopes[-1][carried] = number
            return [], []
        return self._notes(number, line, name, everything)

    def _notes(self, number, line, name, everything) -> tuple[list[str], list[str]]:
        written = _WRITTEN.match(line)
        if written:
            if written[1] in self._scopes[-1]:
                self.written[number] = self._scopes[-1][written[1]]
            return self._bad_value(number, written[1], written[2], everything), []
        result = _RESULT.search(line)
        if not everything or not name or not result:
            return [], []
        return [], self._store(number, name, result[1])

    def _bad_value(self, number, name, dtype, everything) -> list[str]:
        """Notes the thread (or the end of its notes, with the line) at a bad gradient."""
        p = f"%san_{number}_"
        noted = f"%san_id_{number}" if everything else "%san_me"
        slot = "%san_i0" if everything else "%san_i1"
        return [
            f"{p}f = warp.isfinite(%{name}) : ({dtype}) -> i1",
            f"{p}b = arith.xori {p}f, %san_true : i1",
            f"{p}o = warp.load %san[{slot}] : !warp.array<1 x f64>, si32 -> f64",
            f"{p}z = warp.eq({p}o, %san_0) : (f64, f64) -> i1",
            f"{p}c = arith.andi {p}b, {p}z : i1",
            f"{p}d = arith.andi {p}c, {'%san_mine' if everything else '%san_true'} : i1",
            f"scf.if {p}d {{",
            *([f"{noted} = warp.constant {float(number):e} : f64"] if everything else []),
            f"warp.store {noted}, %san[{slot}] : f64, !warp.array<1 x f64>, si32",
            "}",
        ]

    def _store(self, number, name, dtype) -> list[str]:
        p = f"%san_{number}_"
        if dtype == "f64":
            value = [f"{p}v = warp.add(%{name}, %san_0) : (f64, f64) -> f64"]
        elif dtype == "f32":
            value = [f"{p}v = warp.cast %{name} : f32 to f64"]
        else:
            value = [
                f"{p}f = warp.isfinite(%{name}) : ({dtype}) -> i1",
                f"{p}v = warp.where({p}f, %san_0, %san_nan) : (i1, f64, f64) -> f64",
            ]
        return [
            f"{p}o = warp.load %san[%san_i0] : !warp.array<1 x f64>, si32 -> f64",
            f"{p}z = warp.eq({p}o, %san_0) : (f64, f64) -> i1",
            f"{p}c = arith.andi {p}z, %san_mine : i1",
            f"scf.if {p}c {{",
            *value,
            f"{p}i = warp.constant {number + 2} : si32",
            f"warp.store {p}v, %san[{p}i] : f64, !warp.array<1 x f64>, si32",
            "}",
        ]

    def follow(self, board: numpy.ndarray) -> Origin | None:
        """The operation from which a bad gradient comes, by the values that were noted."""
        values = board[2:]
        number = self.written.get(int(board[0]))
        seen: set[int] = set()
        while number is not None and number not in seen:
            seen.add(number)
            operation, location, operands = self.operations[number]
            bad = [one for one in self._sources(number, values) if self._is_bad(one, values, seen)]
            if not bad:
                file, line, column = self.places.get(location, ("", 0, 0))
                known = [self._value(one, values) for one in operands]
                return Origin(operation.removeprefix("warp."), known, file, line, column)
            number = bad[0]
        return None

    def _sources(self, number, values) -> list[int]:
        """Operands that the result may come from; of a choice, all but the condition."""
        operation, _, operands = self.operations[number]
        return operands[1:] if operation == "warp.where" else operands

    def _is_bad(self, number, values, seen) -> bool:
        if number in seen:
            return False
        if self.operations[number][0].startswith("scf."):
            return any(
                self._is_bad(one, values, {*seen, number}) for one in self.operations[number][2]
            )
        return not math.isfinite(values[number])

    def _value(self, number, values):
        line = self.lines[number]
        constant = re.search(r"warp\.constant (\S+) : f\d+", line)
        if constant:
            return float(constant[1])
        noted = re.search(r"-> f(?:32|64) loc", line)
        return float(values[number]) if noted else None


def _with_parameters(line) -> str:
    types = ["!warp.array<1 x f64>", "si32", "si32", "si32", "si32"]
    extra = ", ".join(f"%{name}: {kind}" for name, kind in zip(_EXTRA, types, strict=True))
    head, separator, tail = line.rpartition(") attributes {")
    names = ", ".join(f'"{name}"' for name in _EXTRA)
    tail = re.sub(r"(warp\.arg_names = \[[^\]]*)\]", rf"\1, {names}]", tail)
    return f"{head}, {extra}{separator}{tail}"


def _prologue() -> list[str]:
    """Constants, and the number of the thread."""
    lines = [
        "%san_true = arith.constant true",
        "%san_0 = warp.constant 0.000000e+00 : f64",
        "%san_1 = warp.constant 1.000000e+00 : f64",
        "%san_nan = warp.div(%san_0, %san_0) : (f64, f64) -> f64",
        "%san_i0 = warp.constant 0 : si32",
        "%san_i1 = warp.constant 1 : si32",
        "%san_t:4 = warp.tid : si32, si32, si32, si32",
    ]
    number = "%san_t#0"
    for axis in (1, 2, 3):
        lines += [
            f"%san_m{axis} = warp.mul({number}, %san_d{axis}) : (si32, si32) -> si32",
            f"%san_n{axis} = warp.add(%san_m{axis}, %san_t#{axis}) : (si32, si32) -> si32",
        ]
        number = f"%san_n{axis}"
    return [
        *lines,
        f"%san_mine = warp.eq({number}, %san_target) : (si32, si32) -> i1",
        f"%san_f = warp.cast {number} : si32 to f64",
        "%san_me = warp.add(%san_f, %san_1) : (f64, f64) -> f64",
    ]
