"""Types of the kernels of shapes.py, and the arrays they are given.

A case is a function of a `Data` that returns a `Case`. Names of cases are those of the functions.
Arrays come from a generator of their own per case, so that both packages see the same values.
"""

import os
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

import warp as wp

CASES = {}


@dataclass
class Case:
    """One kernel with its arguments.

    Args:
        kernel: what is launched.
        dim: launch dimensions.
        inputs: arguments; gradients of arrays with `requires_grad` are compared.
        outputs: arrays that the kernel writes, which are compared.
        items: how many of `unit` one launch handles.
        smooth: whether outputs are smooth enough for central differences.
        block: threads of a block, for kernels of tiles; the others leave the choice to the package.
        keep: what the arguments refer to by a number, such as a mesh.
        seeds: adjoints of the outputs before an adjoint launch.
    """

    kernel: object
    dim: object
    inputs: list
    outputs: list
    items: int
    unit: str = "thread"
    smooth: bool = True
    block: int = 0
    keep: object = None
    seeds: tuple = ()

    @property
    def differentiable(self):
        return any(one.requires_grad for one in self.inputs if isinstance(one, wp.array))

    @cached_property
    def adjoints(self):
        """Adjoint arguments of inputs and of outputs, which no timed launch has to make."""
        return [[gradient(one) for one in some] for some in (self.inputs, self.outputs)]

    @cached_property
    def launcher(self):
        """The function that launches, with what is the same for all launches."""
        given = {"dim": self.dim, "inputs": self.inputs, "outputs": self.outputs}
        if self.block:
            return partial(wp.launch_tiled, self.kernel, block_dim=self.block, **given)
        return partial(wp.launch, self.kernel, **given)

    def launch(self, device):
        self.launcher(device=device)

    def launch_adjoint(self, device):
        adj_inputs, adj_outputs = self.adjoints
        self.launcher(device=device, adj_inputs=adj_inputs, adj_outputs=adj_outputs, adjoint=True)

    def seed_adjoints(self):
        for out, seed in zip(self.outputs, self.seeds, strict=True):
            wp.copy(out.grad, seed)

    def launch_seeded(self, device):
        self.seed_adjoints()
        self.launch_adjoint(device)


def gradient(one):
    """The adjoint argument that belongs to an argument."""
    if not isinstance(one, wp.array):
        return one
    return one.grad if one.requires_grad else None


def case(function):
    """Registers a case."""
    CASES[function.__name__] = function
    return function


# Lanes of CPU kernels where the environment gives them, for this package alone.
LANES = {}
if "BENCH_LANES" in os.environ:
    LANES["module_options"] = {"cpu_lanes": int(os.environ["BENCH_LANES"])}


def forward_only(function):
    """A kernel without an adjoint, which need not be compiled."""
    return wp.kernel(function, module="unique", enable_backward=False, **LANES)


def differentiable(function):
    """A kernel with an adjoint, in a module of its own."""
    return wp.kernel(function, module="unique", **LANES)


class Data:
    """Makes the arrays of one case."""

    def __init__(self, device):
        self.device = device
        self.random = np.random.default_rng(7)

    def size(self, cpu, cuda):
        """The size for this device: large enough to be timed, small enough to be quick."""
        return cuda if "cuda" in self.device else cpu

    def given(self, values, dtype, grad=False):
        return wp.array(values, dtype=dtype, device=self.device, requires_grad=grad)

    def real(self, shape, dtype=float, low=0.0, high=1.0, grad=True):
        """Uniform numbers; `shape` includes the components of an element."""
        values = self.random.uniform(low, high, shape)
        kind = np.float64 if dtype is wp.float64 else np.float32
        return self.given(values.astype(kind), dtype, grad)

    def integers(self, shape, low, high, dtype=int):
        return self.given(self.random.integers(low, high, shape), dtype)

    def out(self, shape, dtype=float, grad=True):
        return wp.zeros(shape, dtype=dtype, device=self.device, requires_grad=grad)
