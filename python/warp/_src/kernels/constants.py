"""Launch constants: code for the values that a scene gives to some parameters of a kernel.

`@wp.kernel(launch_constants=("order", "settings.contact"))` names parameters, or fields of structs,
whose values are the same in most launches. Each set of values gets code in which they are numbers:
branches on them, terms that they make zero and loops that they count are settled by the compiler.
Launches stay what they are; a set whose code would hardly differ, and those beyond the first
`MOST_SETS`, run the general code. The choice depends on the code alone, never on times, so results
have the same bits in every run. A kernel without the option knows nothing of all this.
"""

from __future__ import annotations

import dataclasses
import re

from warp._src import errors
from warp._src.kernels.epoch import Epoch
from warp._src.kernels.hooks import LaunchHook
from warp._src.kernels.specializing import argument_type, once
from warp._src.types import dtypes

# Sets of values of one kernel that get code of their own.
MOST_SETS = 8
# Share of the operations that have to differ for code to be worth keeping.
LEAST_CHANGE = 0.03

_KINDS = ("bool", "int", "float", "vec", "mat", "quat", "transform")
_OPERATION = re.compile(r"^ +(?:%\S+(?:, %\S+)* = )?(?!arith\.constant)\w+\.[\w.]+", re.MULTILINE)


@dataclasses.dataclass
class ConstantSet:
    """The facts about one set of values.

    Attributes:
        values: number, or composite, by name.
        native: the native kernel for them; None if they run the general code.
        change: operations that they add or save, as a share of those of the general code.
        launches: how many there were.
    """

    values: dict
    native: object
    change: float
    launches: int = 0

    @property
    def milliseconds(self) -> float:
        """Spent on compiling code for them in this process."""
        return self.native.compile_times().get("compile", 0.0) if self.native else 0.0


class ConstantSets(tuple):
    """The `ConstantSet`s of a kernel; `print` shows a table."""

    @property
    def hit_rate(self) -> float:
        """Share of the launches that ran code of their own; 0 without launches."""
        launches = sum(one.launches for one in self)
        own = sum(one.launches for one in self if one.native is not None)
        return own / launches if launches else 0.0

    def __str__(self):
        lines = []
        for one in self:
            values = ", ".join(f"{name}={value}" for name, value in one.values.items())
            what = f"own code, compiled in {one.milliseconds:.1f} ms" if one.native else "general"
            lines.append(f"{values}: {one.launches} launches, {what}, {one.change:+.0%} operations")
        return "\n".join([*lines, f"{self.hit_rate:.0%} of the launches had code of their own"])


class ConstantCode(LaunchHook):
    """The hook of a kernel with launch constants.

    Raises:
        ValueError: there is no parameter of a name that the option lists, or one stands there
            twice.
    """

    role = "constants"

    def __init__(self, kernel):
        self._sets: dict = {}
        self._types: dict = {}
        code = kernel.func.__code__
        parameters = code.co_varnames[: code.co_argcount]
        self._paths = []
        for path in kernel.options.get("launch_constants") or ():
            name, _, field = path.partition(".")
            if name not in parameters or path in [known for known, *_ in self._paths]:
                problem = "is listed twice" if name in parameters else "is no parameter"
                raise ValueError(
                    f"launch_constants: '{path}' {problem} of kernel '{kernel.key}', "
                    f"which has {', '.join(map(repr, parameters))}"
                )
            self._paths.append((path, parameters.index(name), field))

    def reset(self) -> None:
        self._sets.clear()
        self._types.clear()

    @property
    def sets(self) -> ConstantSets:
        """The facts about the values that launches had so far."""
        return ConstantSets(one for key, one in self._sets.items() if key[0] is Epoch.current)

    def place(self, kernel, native, dim, index, block_dim, values, recorded):
        """The native kernel for a launch: that of its constants, if they have one.

        Arguments of recorded launches may be changed, so these run the general code.
        """
        if recorded:
            return native, block_dim
        types = self._types.get(native)
        if types is None:
            types = self._types[native] = self._types_of(kernel, native)
        try:
            constants = [
                _held(dtype, getattr(values[position], field) if field else values[position])
                for dtype, (_, position, field) in zip(types, self._paths, strict=True)
            ]
        except (TypeError, ValueError, AttributeError, IndexError, OverflowError):
            # The launch says what is wrong.
            return native, block_dim
        key = (Epoch.current, native, *map(repr, constants))
        found = self._sets.get(key)
        if found is None:
            if len(self.sets) >= MOST_SETS:
                return native, block_dim
            found = once(self._sets, key, lambda: self._make(kernel, native, constants, values))
        found.launches += 1
        return found.native or native, block_dim

    def _types_of(self, kernel, native) -> list:
        """Types of the constants, for a native kernel.

        Raises:
            WarpLaunchTypeError: one is not of numbers.
            WarpLaunchValueError: a struct has no such field.
        """
        found = []
        for path, position, field in self._paths:
            dtype = dtypes.dtype_of(native.parameters[position][2])
            if field:
                fields = getattr(dtype, "_wp_fields_", {})
                if field not in fields:
                    raise errors.WarpLaunchValueError(
                        f"launch('{kernel.key}'): launch constant '{path}' is no field of a struct"
                    )
                dtype = dtypes.canonical(fields[field])
            if dtypes.native_type(dtype).kind not in _KINDS:
                raise errors.WarpLaunchTypeError(
                    f"launch('{kernel.key}'): launch constant '{path}' expects a number, vector, "
                    f"matrix, quaternion or transform, but got '{dtypes.type_repr(dtype)}'"
                )
            found.append(dtype)
        return found

    def _make(self, kernel, native, constants, values) -> ConstantSet:
        named = {path: constant for (path, *_), constant in zip(self._paths, constants)}
        types = tuple(map(argument_type, values)) if kernel.is_generic else None
        try:
            made = kernel._translate(types, constants=named)
        except errors.WarpCodegenError:
            # An error for these values may stand where they never lead.
            return ConstantSet(named, None, 0.0)
        before, after = _count(native), _count(made)
        change = (after - before) / max(before, 1)
        return ConstantSet(named, made if abs(change) >= LEAST_CHANGE else None, change)


def _held(dtype, value):
    """A value as the parameter holds it."""
    return value if type(value) is dtype else dtype(value)


def _count(native) -> int:
    """Operations of one thread, constants left out."""
    return len(_OPERATION.findall(native.ir("thread")))
