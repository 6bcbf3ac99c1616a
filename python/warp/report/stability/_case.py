"""Cases of the catalogue: each measures errors against limits and keeps the worst input."""

import functools
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import warp as wp
from warp.report._measure import measure
from warp.report._scene import Case as ScenePoint
from warp.report._scene import registered as scenes

#: From best to worst; a case is as bad as its worst check.
VERDICTS = ("pass", "diagnosed", "absent", "fail")

SECTIONS = {
    "D": "stiff and long-time dynamics",
    "F": "materials and elements",
    "G": "geometry",
    "R": "rotations and small dense matrices",
    "N": "floating point, reductions, determinism",
    "S": "spatial structures, scans and sorts",
    "L": "gradients over long horizons",
}


@dataclass(frozen=True)
class StabilityCase:
    """A registered case; made by `case`."""

    name: str
    summary: str
    run: Callable
    dtypes: tuple[str, ...]


_registry: dict[str, StabilityCase] = {}


def registered():
    """Cases by name."""
    return _registry


def case(name, summary, dtypes=("float64",)):
    """Register a function of a `Probe` as a case; it runs once for each of `dtypes`."""

    def decorate(function):
        _registry[name] = StabilityCase(name, summary, function, tuple(dtypes))
        return function

    return decorate


@dataclass
class Probe:
    """The measure of a case.

    Attributes:
        device: such as 'cpu'.
        dtype: name of the precision.
        checks: what was found, one dictionary for each check.
    """

    device: str
    dtype: str
    checks: list = field(default_factory=list)

    @property
    def real(self):
        return getattr(wp, self.dtype)

    @property
    def u(self):
        """Unit round-off, half the distance from 1 to the next number."""
        return float(np.finfo(self.dtype).eps) / 2.0

    @functools.cached_property
    def random(self):
        """Random numbers, the same in each run."""
        return np.random.default_rng(20)

    def vector(self, length):
        return wp.types.vector(length, self.real)

    def matrix(self, rows, columns):
        return wp.types.matrix((rows, columns), self.real)

    @property
    def quat(self):
        return wp.types.quaternion(self.real)

    def array(self, values, dtype=None, **options):
        """An array of the case's precision on its device."""
        return wp.array(np.asarray(values), dtype=dtype or self.real, device=self.device, **options)

    def zeros(self, shape, dtype=None, **options):
        return wp.zeros(shape, dtype=dtype or self.real, device=self.device, **options)

    def launch(self, kernel, dim, *inputs):
        wp.launch(kernel, dim, list(inputs), device=self.device)

    def map(self, function, *operands):
        """`function` of each operand; NumPy arrays in the case's precision."""
        found = wp.map(function, *operands)
        if isinstance(found, (list, tuple)):
            return [one.numpy() for one in found]
        return found.numpy()

    def check(self, what, error, limit, **operands):
        """An error, or one for each row of the operands, may not pass a limit.

        A value that is no number passes every limit. The operands at the largest error are kept.
        """
        error = np.atleast_1d(np.asarray(error, np.float64))
        error = np.where(np.isnan(error), np.inf, np.abs(error))
        worst = int(error.argmax()) if error.size else 0
        largest = float(error[worst]) if error.size else 0.0
        found = {"what": what, "error": largest, "limit": float(limit)}
        found["verdict"] = "pass" if largest <= limit else "fail"
        found["operands"] = {name: _row(value, worst) for name, value in operands.items()}
        self.checks.append(found)

    def holds(self, what, truth, **operands):
        """Something is true, or true for each row of the operands."""
        self.check(what, np.where(np.atleast_1d(truth), 0.0, np.inf), 0.0, **operands)

    def diagnosed(self, what, function, *words):
        """A call is refused by a message with these words; a silent result fails."""
        try:
            function()
        except Exception as error:
            text = f"{type(error).__name__}: {error}"
            good = all(word in text for word in words)
            self._say(what, "diagnosed" if good else "fail", text)
        else:
            self._say(what, "fail", "accepted without a message")

    def explained(self, what, text):
        """The report itself says why no right result can be expected."""
        self._say(what, "diagnosed", text)

    def absent(self, name):
        """True if the package does not have a name, whose use then is an error that says so."""
        try:
            getattr(wp, name)()
        except TypeError:
            # It is there and expects arguments.
            return False
        except (wp.WarpError, NotImplementedError, AttributeError) as error:
            if name not in str(error):
                return False
            self._say(name, "absent", str(error))
            return True
        return False

    def note(self, what, value):
        """A figure that is reported, not judged."""
        self._say(what, "pass", f"{value:.3g}" if isinstance(value, float) else str(value))

    def scene(self, name, limits, **parameters):
        """A point of a scene of the report: its errors may not pass limits."""
        scene = scenes()[name]
        point = ScenePoint(self.device, self.dtype, {**scene.fixed, **parameters}, quick=True)
        record = measure(scene, point, repeats=1, budget=0.0)
        if not limits:
            good = record["verdict"] == "green"
            self.checks.append(
                {"what": f"scene {name}", "verdict": "pass" if good else "fail"}
                | {"text": f"{record['status']}, {record.get('reason', '')}"}
                | {"operands": _plain(parameters)}
            )
        for quantity, limit in limits.items():
            error = record["errors"].get(quantity, record["unjudged"].get(quantity, math.nan))
            self.check(f"{name}: {quantity}", error, limit, **parameters)
        return record

    def _say(self, what, verdict, text):
        self.checks.append({"what": what, "verdict": verdict, "text": text, "operands": {}})


def _row(value, index):
    value = np.asarray(value)
    if value.dtype == np.longdouble:
        value = value.astype(np.float64)
    return (value[index] if value.ndim and len(value) > index else value).tolist()


def _plain(parameters):
    return {name: np.asarray(value).tolist() for name, value in parameters.items()}


def run_case(name, device):
    """Records of one case, one for each precision.

    An exception is a failure that names where it was raised.
    """
    import traceback

    found = _registry[name]
    records = []
    for dtype in found.dtypes:
        probe = Probe(device, dtype)
        try:
            # Some geometries and fields know no device but the current one.
            with wp.ScopedDevice(device):
                found.run(probe)
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            text = f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})"
            probe._say("raised", "fail", text)
        worst = max(probe.checks, key=lambda check: VERDICTS.index(check["verdict"]), default=None)
        verdict = worst["verdict"] if worst else "fail"
        records.append(
            {"case": name, "summary": found.summary, "device": device, "dtype": dtype}
            | {"verdict": verdict, "checks": probe.checks}
        )
    return records


def in_order(names):
    """Names sorted as in the catalogue: by section, then by number."""
    sections = list(SECTIONS)
    return sorted(names, key=lambda name: (sections.index(name[0]), int(name[1:])))


def expand(selected):
    """Names from those on a command line: 'R', 'R1', 'D1-D9'.

    Raises:
        ValueError: nothing of that name.
    """
    known = in_order(_registry)
    if not selected:
        return known
    chosen = list(itertools.chain.from_iterable(_matching(one, known) for one in selected))
    return [name for name in known if name in chosen]


def _matching(text, known):
    first, _, last = text.partition("-")
    if first in known and (not last or last in known):
        return known[known.index(first) : known.index(last or first) + 1]
    found = [name for name in known if name[0] == text]
    if not found:
        raise ValueError(f"no case '{text}'; there are {', '.join(known)}")
    return found
