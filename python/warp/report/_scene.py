"""Scenes: a program with parameters to sweep, quantities and a reference."""

import contextlib
import itertools
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

import warp as wp

DTYPES = {"float16": "float16", "float32": "float32", "float64": "float64"}


@dataclass(frozen=True)
class Sweep:
    """Values of one parameter, by default equally spaced in the logarithm.

    Args:
        name: the parameter, read in a scene as an attribute of its `Case`.
        first, last: ends of the sweep, both included; positive unless `values` are given.
        count: how many values.
        values: the values themselves, in place of the three above.
        quick: how many of them a quick run takes (spread over the whole sweep).

    Raises:
        ValueError: no values, or ends that have no logarithm.
    """

    name: str
    first: float = 0.0
    last: float = 0.0
    count: int = 1
    values: tuple = ()
    quick: int = 4

    def __post_init__(self):
        if self.values:
            object.__setattr__(self, "values", tuple(self.values))
            return
        if self.count < 1:
            raise ValueError(f"sweep of '{self.name}' expects at least one value")
        if not (self.first > 0.0 and self.last > 0.0):
            raise ValueError(
                f"sweep of '{self.name}' expects positive ends, "
                f"but got {self.first:g} and {self.last:g}; give `values` instead"
            )
        values = np.geomspace(self.first, self.last, self.count).tolist()
        object.__setattr__(self, "values", tuple(values))

    def pick(self, quick):
        """The values of a full or of a quick run."""
        if not quick or len(self.values) <= self.quick:
            return self.values
        index = np.linspace(0, len(self.values) - 1, self.quick).round().astype(int)
        return tuple(self.values[i] for i in index)

    @classmethod
    def parse(cls, text):
        """A sweep from `name=first:last:count` or `name=value,value`, as on the command line.

        Raises:
            ValueError: the text is no sweep.
        """
        name, separator, rest = text.partition("=")
        try:
            if not (name and separator and rest):
                raise ValueError
            if ":" in rest:
                first, last, count = rest.split(":")
                return cls(name, float(first), float(last), int(count))
            return cls(name, values=tuple(_number(value) for value in rest.split(",")))
        except ValueError as error:
            hint = f" ({error})" if str(error).startswith("sweep of") else ""
            raise ValueError(
                "sweep expects 'name=first:last:count' or 'name=value,value', "
                f"but got '{text}'{hint}"
            ) from None


def _number(text):
    try:
        number = float(text)
    except ValueError:
        return text
    return int(number) if number.is_integer() and "." not in text and "e" not in text else number


@dataclass(frozen=True)
class Series:
    """A quantity over time whose distance from zero is an error: drift of an energy, say.

    Args:
        time: shape (n,) [s].
        error: shape (n,), relative.
    """

    time: np.ndarray
    error: np.ndarray


@dataclass(frozen=True)
class Error:
    """An error that needs no reference: a residual, a penetration, a violated constraint."""

    value: float


@dataclass
class Program:
    """The result of a scene's function: the parts of one run.

    Args:
        run: does the work that is timed; launches need not be waited for.
        quantities: after a run, `{name: array, Series or Error}`. An array is compared with the
            reference's of that name.
        reset: back to the start, before each run; not timed.
        gradient: after a run, the gradient as an array, compared with the reference's "gradient";
            timed apart.
        work: items (particles, cells) times steps of a run, for rates.
    """

    run: Callable[[], None]
    quantities: Callable[[], dict]
    reset: Callable[[], None] | None = None
    gradient: Callable[[], np.ndarray] | None = None
    work: int = 0


@dataclass
class Case:
    """One point of a sweep; parameters are attributes: `case.dt`, `case.method`.

    Attributes:
        device: such as 'cpu' or 'cuda:0'.
        dtype: 'float32' or 'float64'; `real` and `vec3` are the types.
        quick: whether this is a quick run, for scenes with a size of their own.
    """

    device: str
    dtype: str
    parameters: Mapping[str, object]
    quick: bool = False
    parts: dict[str, float] = field(default_factory=dict)
    profiling: bool = False

    def __getattr__(self, name):
        parameters = self.__dict__.get("parameters", {})
        if name in parameters:
            return parameters[name]
        known = ", ".join(f"'{key}'" for key in parameters) or "none"
        raise AttributeError(f"case has no parameter '{name}'; it has {known}")

    @property
    def real(self):
        """Scalar type of the run."""
        return getattr(wp, self.dtype)

    @property
    def vec3(self):
        """Three of `real`."""
        return wp.types.vector(3, self.real)

    @contextlib.contextmanager
    def part(self, name):
        """Time a part of `run` under a name.

        Costs nothing in timed runs: parts are measured in a run of their own, in which the device
        is waited for around each.
        """
        if not self.profiling:
            self.parts.setdefault(name, 0.0)
            yield
            return
        wp.synchronize_device(self.device)
        begin = time.perf_counter()
        yield
        wp.synchronize_device(self.device)
        self.parts[name] += time.perf_counter() - begin


@dataclass
class Scene:
    """A registered scene; made by `scene`."""

    name: str
    build: Callable[[Case], Program]
    sweep: Sweep
    curves: tuple[Sweep, ...]
    reference: object
    dtypes: tuple[str, ...]
    limits: Callable[[Case], dict]
    expect: Callable[[Case], str]
    diverged: float
    fixed: dict
    file: str
    summary: str

    def cases(self, devices, dtypes=None, sweeps=(), quick=False):
        """Every point: devices x dtypes x curves x the sweep, the sweep fastest.

        Raises:
            ValueError: a sweep is of a parameter that the scene does not have.
        """
        replaced = {sweep.name: sweep for sweep in sweeps}
        axes = [*self.curves, self.sweep]
        unknown = set(replaced) - {axis.name for axis in axes} - set(self.fixed)
        if unknown:
            known = ", ".join(f"'{name}'" for name in [*(a.name for a in axes), *self.fixed])
            raise ValueError(
                f"scene '{self.name}' has no parameter '{sorted(unknown)[0]}'; it has {known}"
            )
        extra = [replaced[name] for name in self.fixed if name in replaced]
        lists = [
            replaced[axis.name].values if axis.name in replaced else axis.pick(quick)
            for axis in axes
        ]
        axes, lists = [*extra, *axes], [*(sweep.values for sweep in extra), *lists]
        chosen = [dtype for dtype in (dtypes or self.dtypes) if dtype in self.dtypes]
        for device, dtype in itertools.product(devices, chosen):
            for values in itertools.product(*lists):
                point = dict(zip((axis.name for axis in axes), values))
                yield Case(device, dtype, {**self.fixed, **point}, quick)


_registry: dict[str, Scene] = {}


def registered():
    """Scenes by name, in the order in which they were registered."""
    return _registry


def scene(
    *,
    sweep,
    curves=(),
    reference=None,
    dtypes=("float32", "float64"),
    limits=None,
    expect=None,
    diverged=1.0,
    name=None,
    **fixed,
):
    """Register a function as a scene.

    Args:
        sweep: `Sweep` along which error and time are drawn (a step size, a tolerance, a horizon).
        curves: further `Sweep`s; every combination is a curve. Two numeric sweeps without a curve
            of names make a stability map.
        reference: `Exact`, `Tabulated` or `Converged`; none if all quantities are errors.
        dtypes: precisions that the scene runs in.
        limits: errors by name that a point may not pass, or a function of the case that gives
            them.
        expect: function of the case: what a right program does there, 'ok', 'diverged', or 'any'
            where nothing can be said.
        diverged: relative error at which a run counts as diverged.
        name: instead of the function's.
        **fixed: further parameters and their values.

    Returns:
        The `Scene`, whose function takes a `Case` and returns a `Program`.

    Raises:
        ValueError: a second scene of the same name from another file, a dtype that there is not.
    """
    for dtype in dtypes:
        if dtype not in DTYPES:
            known = ", ".join(f"'{key}'" for key in DTYPES)
            raise ValueError(f"scene expects dtypes of {known}, but got '{dtype}'")

    def decorate(function):
        label = name or function.__name__
        file = function.__code__.co_filename
        before = _registry.get(label)
        if before is not None and before.file != file:
            raise ValueError(f"scene '{label}' of '{file}' is already there, from '{before.file}'")
        bounds = limits if callable(limits) else lambda case: limits or {}
        made = Scene(
            name=label,
            build=function,
            sweep=sweep,
            curves=tuple(curves),
            reference=reference,
            dtypes=tuple(dtypes),
            limits=bounds,
            expect=expect or (lambda case: "ok"),
            diverged=diverged,
            fixed=fixed,
            file=file,
            summary=(function.__doc__ or "").strip().split("\n")[0],
        )
        _registry[label] = made
        return made

    return decorate
