"""Random stencils: adjoints are transposed Jacobians."""

import numpy as np
from hypothesis import given

from random_runs import examples
from stencil_programs import check, stencils


@examples(60)
@given(stencils())
def test_random_stencils(program):
    source, extents, dims = program
    rng = np.random.default_rng(len(source))
    check(source, dims, [rng.normal(size=extents), rng.normal(size=dims)], gathered=None)
