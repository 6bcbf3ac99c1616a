"""Random stencils: adjoints are transposed Jacobians."""

import numpy as np
from hypothesis import HealthCheck, given, settings

from stencil_programs import check, stencils


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(stencils())
def test_random_stencils(program):
    source, extents, dims = program
    rng = np.random.default_rng(len(source))
    check(source, dims, [rng.normal(size=extents), rng.normal(size=dims)], gathered=None)
