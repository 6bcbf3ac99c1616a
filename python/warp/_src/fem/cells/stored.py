"""Stored tables of elements - rules and coefficients that `scripts/make_fem_elements.py` wrote."""

from __future__ import annotations

import functools
import os

import numpy as np


@functools.cache
def stored() -> dict:
    """Arrays by name, such as "rule triangle 5": (q, d + 1) parameters and weights of points."""
    path = os.path.join(os.path.dirname(__file__), "elements.npz")
    with np.load(path) as tables:
        return {name: tables[name] for name in tables.files}
