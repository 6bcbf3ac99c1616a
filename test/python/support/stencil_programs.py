"""Kernels over grids, run in plain Python with dual numbers: what their adjoints have to do."""

import itertools

import numpy as np
from hypothesis import strategies as st

import warp as wp
from autodiff_programs import Dual, Functions
from frontend_programs import define

REAL = wp.float64


class Grid(Functions):
    """The names of `wp` that kernels use, one thread after the other."""

    index = ()

    @staticmethod
    def kernel(function):
        return function

    @staticmethod
    def tid():
        return Grid.index if len(Grid.index) > 1 else Grid.index[0]

    @staticmethod
    def atomic_add(array, index, value):
        array[index] = array[index] + value


def jacobian(source, dims, arrays, scalars):
    """Derivatives of what the arrays hold after a launch by what they held before it."""
    sizes = [a.size for a in arrays]
    total, first, duals = sum(sizes), 0, []
    for values in arrays:
        held = np.empty(values.shape, dtype=object)
        for place, index in enumerate(np.ndindex(values.shape)):
            held[index] = Dual(values[index], np.eye(total)[first + place])
        first += values.size
        duals.append(held)
    kernel = define(source, wp=Grid, A1=None, A2=None, A3=None, A4=None, R=Dual)["kernel"]
    scalars = [Dual(s) if isinstance(s, float) else s for s in scalars]
    for Grid.index in itertools.product(*map(range, dims)):
        kernel(*duals, *scalars)
    return np.array([d.slope + np.zeros(total) for held in duals for d in held.ravel()])


def compiled(source):
    """The kernel of the same source."""
    names = {f"A{n}": wp.array(dtype=REAL, ndim=n) for n in (1, 2, 3, 4)}
    return define(source, R=REAL, **names)["kernel"]


def check(source, dims, arrays, scalars=(), device="cpu", gathered=True):
    """Compares the adjoint of a launch with the transposed Jacobian.

    Args:
        source: the module text of the kernel; arrays come before scalars.
        gathered: whether its adjoint has no atomic additions; None if that does not matter.

    Returns:
        The kernel.
    """
    dims = dims if isinstance(dims, tuple) else (dims,)
    rng = np.random.default_rng(7)
    before = [rng.normal(size=a.shape) for a in arrays]
    wanted = np.concatenate([g.ravel() for g in before]) @ jacobian(source, dims, arrays, scalars)
    kernel = compiled(source)
    made = [wp.array(a, dtype=REAL, device=device, requires_grad=True) for a in arrays]
    for one, gradient in zip(made, before):
        one.grad.assign(gradient)
    wp.launch(kernel, dims, [*made, *scalars], adjoint=True, device=device)
    got = np.concatenate([one.grad.numpy().ravel() for one in made])
    np.testing.assert_allclose(got, wanted, rtol=1e-10, atol=1e-12, err_msg=source)
    if gathered is not None:
        assert (wp.autograd.adjoint_metrics(kernel)["atomics"] == 0) == gathered, source
    return kernel


NAMES = "ijk"


def _index(draw, name, offset):
    """A spelling of `name + offset`."""
    if offset == 0:
        return name
    forms = [f"{name} + {offset}" if offset > 0 else f"{name} - {-offset}"]
    forms += [f"{offset} + {name}", f"{name} + {offset + 3} - 3", f"({name} - 2) + {offset + 2}"]
    return draw(st.sampled_from(forms))


def _lower(draw, name, least):
    """A condition that holds from `least` on."""
    forms = [f"{name} >= {least}", f"{name} > {least - 1}", f"{least} <= {name}"]
    forms += [f"not {name} < {least}", f"{name} + 1 > {least}"]
    return draw(st.sampled_from(forms))


@st.composite
def stencils(draw):
    """A kernel that reads around its thread, the extents of what it reads, and of the launch."""
    rank = draw(st.integers(1, 3))
    points = draw(
        st.lists(st.tuples(*[st.integers(-2, 2)] * rank), min_size=1, max_size=5, unique=True)
    )
    names = NAMES[:rank]
    order = draw(st.permutations(range(rank)))
    reads = [
        "x[" + ", ".join(_index(draw, names[d], point[d]) for d in order) + "]" for point in points
    ]
    conditions = []
    for place, d in enumerate(order):
        least = -min(0, *(point[d] for point in points), 0)
        most = max(0, *(point[d] for point in points), 0)
        if least:
            conditions.append(_lower(draw, names[d], least))
        conditions.append(f"{names[d]} + {most} < x.shape[{place}]")
    value = "R(1.5)"
    for read in reads:
        value = draw(st.sampled_from(VALUES)).format(value, read, draw(st.sampled_from(reads)))
    target = f"y[{', '.join(names)}]"
    guard = " and ".join(draw(st.permutations(conditions)))
    body = draw(st.sampled_from(BODIES)).format(guard=guard, target=target, value=value)
    source = f"""
@wp.kernel
def kernel(x: A{rank}, y: A{rank}):
    {", ".join(names)} = wp.tid()
{body}"""
    extents = st.tuples(*[st.integers(1, 5)] * rank)
    return source, draw(extents), draw(extents)


VALUES = (
    "{0} + R(0.5) * {1}",
    "({0}) * {1}",
    "{0} - {1} * {2}",
    "wp.sin({0}) + {1}",
    "{0} + ({1} if {2} > R(0.1) else R(2.0) * {1})",
)
BODIES = (
    "    if {guard}:\n        {target} = {value}\n",
    "    if not ({guard}):\n        return\n    {target} = {value}\n",
    "    if {guard}:\n        {target} += {value}\n    else:\n        {target} = R(3.0)\n",
)
