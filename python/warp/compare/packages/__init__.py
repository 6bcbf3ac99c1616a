"""The programs of the comparison, a file per package.

Each file has `VERSION`, `PROGRAMS` by name and `build(name, inputs, weights, device)`, which
returns a `Run`.
"""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Run:
    """A program with its inputs on a device.

    Args:
        forward: runs it and waits for the result.
        result: the last result as an array.
        backward: runs it and its derivative and waits; none where the package has none.
        gradient: the last gradient as an array.
    """

    forward: Callable
    result: Callable
    backward: Callable | None = None
    gradient: Callable | None = None
