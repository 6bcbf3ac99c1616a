"""The same programs by several packages: run time, compile time, memory, errors, gradients.

    python -m warp.compare --python peer=/path/to/python --python jax=/path/to/python

Each program of each package runs in a process of its own, by the interpreter that has the package,
with empty caches. See `docs/compare.md`.
"""

from warp.compare._run import PACKAGES as PACKAGES
from warp.compare._run import compare as compare
