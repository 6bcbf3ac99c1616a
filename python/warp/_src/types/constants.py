"""Mathematical constants and `wp.constant`."""

from __future__ import annotations

import builtins
import enum
import math

from warp._src import errors
from warp._src.types.composites import Composite
from warp._src.types.scalars import scalar_base

E = math.e
LOG2E = 1.0 / math.log(2.0)
LOG10E = 1.0 / math.log(10.0)
LN2 = math.log(2.0)
LN10 = math.log(10.0)
PHI = (1.0 + math.sqrt(5.0)) / 2.0
PI = math.pi
HALF_PI = math.pi / 2.0
TAU = math.tau
INF = math.inf
NAN = math.nan

e = E
log2e = LOG2E
log10e = LOG10E
ln2 = LN2
ln10 = LN10
phi = PHI
pi = PI
half_pi = HALF_PI
tau = TAU
inf = INF
nan = NAN


def is_constant(value) -> builtins.bool:
    """True if kernels can capture `value` as a constant."""
    return isinstance(value, (int, float, enum.Enum, scalar_base, Composite))


def constant(x):
    """Checks that `x` can be captured by kernels as a constant, and returns it.

    Raises:
        TypeError: `x` is neither a number, a Warp scalar, a composite nor an int enum.
    """
    if not is_constant(x):
        raise errors.WarpTypeError(
            f"expects a number, vector, matrix, quaternion or transform as a constant, "
            f"but got '{type(x).__name__}'",
            code="constant-type",
            facts={"kind": str(type(x))},
        )
    return x


__all__ = sorted(
    name
    for name, value in list(globals().items())
    if isinstance(value, float) or name == "constant"
)
