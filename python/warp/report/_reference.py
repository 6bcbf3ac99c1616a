"""References, each with an error bar of its own.

An error is judged only if it is ten times the bar of what it is compared with; below that the
point says so and gives no figure.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from warp.report._scene import Case

#: An error smaller than this many error bars of its reference is not judged.
MARGIN = 10.0


@dataclass(frozen=True)
class Exact:
    """A closed form, or numbers that mpmath or the like made while the report runs.

    Args:
        function: of the case; `{name: array}` in float64.
        error: relative error bar of what it gives.
    """

    function: Callable[[Case], dict]
    error: float = 2.0**-52

    def evaluate(self, scene, case, measure):
        """Values and error bars by quantity, for a case."""
        values = {name: np.asarray(v, np.float64) for name, v in self.function(case).items()}
        return values, dict.fromkeys(values, self.error)


@dataclass(frozen=True)
class Tabulated:
    """Numbers from elsewhere.

    Args:
        values: `{name: array}`, or a function of the case that gives them.
        error: relative error bar.
        source: where the numbers come from.
    """

    values: object
    error: float
    source: str

    def evaluate(self, scene, case, measure):
        """Values and error bars by quantity, for a case."""
        values = self.values(case) if callable(self.values) else self.values
        values = {name: np.asarray(v, np.float64) for name, v in values.items()}
        return values, dict.fromkeys(values, self.error)


@dataclass(frozen=True)
class Converged:
    """Self-convergence by two methods: two settings of the scene itself, in float64 on the CPU.

    The first gives the values, the difference between the two the error bar. Choose two that do
    not share their mistakes: different schemes, not two step sizes of one.

    Args:
        first, second: parameters that are set in place of the case's, such as
            `{"method": "implicit midpoint", "dt": 1e-5}`.
    """

    first: dict
    second: dict
    cache: dict = field(default_factory=dict, compare=False, repr=False)

    def evaluate(self, scene, case, measure):
        """Values and error bars by quantity, for a case."""
        own = set(self.first) | set(self.second)
        rest = {name: value for name, value in case.parameters.items() if name not in own}
        key = (scene.name, case.quick, tuple(sorted(rest.items())))
        if key not in self.cache:
            runs = [
                measure(scene, Case("cpu", "float64", {**case.parameters, **setting}, case.quick))
                for setting in (self.first, self.second)
            ]
            arrays = [name for name, value in runs[0].items() if isinstance(value, np.ndarray)]
            values = {name: runs[0][name].astype(np.float64) for name in arrays}
            bars = {name: relative_error(runs[1][name], values[name]) for name in arrays}
            self.cache[key] = values, bars
        return self.cache[key]


def relative_error(value, reference):
    """Norm of the difference over the norm of the reference (the difference's own if that is 0).

    Raises:
        ValueError: the shapes differ.
    """
    value = np.asarray(value, np.float64)
    if value.shape != reference.shape:
        raise ValueError(
            f"quantity has shape {value.shape}, but its reference has {reference.shape}"
        )
    with np.errstate(all="ignore"):
        scale = np.linalg.norm(reference.ravel())
        difference = np.linalg.norm((value - reference).ravel())
        return float(difference / scale if scale > 0.0 else difference)
