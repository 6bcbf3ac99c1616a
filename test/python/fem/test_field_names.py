"""Fields may have any name: kernels of forms have names of their own."""

import numpy as np
import pytest

import warp as wp
from warp import extend, fem

NAMES = ["a", "c", "d", "r", "test"]
OTHERS = [f"coefficient_{k}" for k in range(len(NAMES))]


def form(names):
    """A bilinear form with a coefficient field of each name."""
    given = {"Sample": fem.Sample, "Field": fem.Field, "grad": fem.grad, "dot": wp.dot}
    weight = " + ".join(f"{k + 1}.0 * {n}(s) * grad({n}, s)[0]" for k, n in enumerate(names))
    text = (
        f"def weighted(s: Sample, {', '.join(f'{n}: Field' for n in names)}, u: Field, v: Field):\n"
        f"    weight = {weight}\n"
        "    return weight * (dot(grad(u, s), grad(v, s)) + u(s) * v(s))\n"
    )
    return fem.integrand(extend.function_from_text(text, given, module=__name__))


def results(names, space, kind):
    n = space.node_count()
    fields = {}
    for k, name in enumerate([*names, "u"]):
        fields[name] = space.make_field()
        values = np.sin(np.arange(n) + k)
        fields[name].dof_values = wp.array(values, dtype=wp.float64, requires_grad=True)
    if kind == "matrix":
        fields["u"] = fem.make_trial(space)
    fields["v"] = fem.make_test(space)
    with wp.Tape() as tape:
        made = fem.integrate(form(names), fields=fields)
    values = made.values if kind == "matrix" else made
    tape.backward(grads={values: wp.ones_like(values)})
    return [values.numpy(), *(fields[name].dof_values.grad.numpy() for name in names)]


@pytest.fixture(scope="module")
def space():
    grid = fem.Grid2D(res=wp.vec2i(3, 2), scalar_type=wp.float64)
    return fem.make_polynomial_space(grid, degree=2, dtype=wp.float64)


@pytest.mark.parametrize("kind", ["matrix", "vector"])
def test_results_do_not_depend_on_names(space, kind):
    pairs = zip(results(NAMES, space, kind), results(OTHERS, space, kind), strict=True)
    for found, wanted in pairs:
        np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-11)
