"""A kernel or a Python function as a map from arrays to arrays that can be evaluated again."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Sequence

import numpy

from warp import _native
from warp._src import errors
from warp._src.arrays.array import array
from warp._src.arrays.observers import Observing, copy_layout
from warp._src.kernels.call import signature_of, struct_leaves, struct_of
from warp._src.kernels.kernel import Kernel
from warp._src.kernels.launch import launch
from warp._src.types import dtypes, scalars
from warp._src.types.structs import StructInstance


@dataclasses.dataclass
class Variable:
    """An input or output that has a gradient.

    Attributes:
        key: its position among the inputs or outputs; of an array in a struct, its name.
        name: of the parameter.
        array: the array; that of the last evaluation for outputs of Python functions.
    """

    key: int | str
    name: str
    array: array

    @property
    def length(self) -> int:
        """Number of scalars."""
        return self.array.size * components(self.array.dtype)


def components(dtype) -> int:
    """Number of scalars in an element."""
    return getattr(dtype, "_length_", 1)


@dataclasses.dataclass
class FunctionMetadata:
    """Names for pictures and tables.

    Attributes:
        key: name of the function.
        input_labels, output_labels: names by position, in a list or a dictionary; outputs without
            names are `output_0`, `output_1`, ...
        input_strides, output_strides, input_dtypes, output_dtypes: of arrays, None for others;
            nothing here needs them.
    """

    key: str | None = None
    input_labels: list | dict | None = None
    output_labels: list | dict | None = None
    input_strides: list | None = None
    output_strides: list | None = None
    input_dtypes: list | None = None
    output_dtypes: list | None = None


class Evaluation(_native.Scope):
    """A function with its arguments.

    Args:
        function: a kernel or a Python function that launches kernels.
        dim: extents of the kernel's launch.
        inputs: arguments; gradients are those of arrays with `requires_grad`.
        outputs: further arguments of a kernel, that it writes. A Python function may return its
            outputs, or write those named here.
        restore: whether the arrays get back the contents that they have now.

    Raises:
        WarpGradientError: no input or no output has a gradient.
    """

    def __init__(
        self,
        function: Kernel | Callable,
        dim=None,
        inputs: Sequence | None = None,
        outputs: Sequence | None = None,
        device=None,
        block_dim: int | None = None,
        metadata: FunctionMetadata | None = None,
        restore: bool = True,
    ):
        self.function, self.dim = function, dim
        self.values, self.targets = list(inputs or ()), list(outputs or ())
        self.device, self.block_dim = device, block_dim
        self.is_kernel = isinstance(function, Kernel)
        self.label = getattr(function, "key", None) or getattr(function, "__name__", "function")
        self.metadata = metadata
        if self.is_kernel and dim is None:
            raise ValueError(f"expects `dim` to launch kernel '{self.label}'")
        self._saved = [(one, copy_layout(one)) for one in self._all_arrays()]
        self.restore_at_end = restore
        names = self._names()
        self.inputs = _variables(names, self.values)
        self.outputs: list[Variable] = []
        if self.is_kernel:
            self.outputs = self._kernel_outputs(names)
        if not self.inputs:
            raise errors.WarpGradientError(
                f"no input of '{self.label}' has a gradient",
                hint="make input arrays with `requires_grad=True`",
            )

    def _all_arrays(self) -> list[array]:
        found = {}
        for value in (*self.values, *self.targets):
            value = struct_of(value)
            held = value.arrays() if isinstance(value, StructInstance) else (value,)
            found.update((id(one), one) for one in held if isinstance(one, array))
        return list(found.values())

    def _names(self) -> list[str]:
        if self.is_kernel:
            code = self.function.func.__code__
            return list(code.co_varnames[: code.co_argcount])
        try:
            return list(inspect.signature(self.function).parameters)
        except (TypeError, ValueError):
            return [f"input_{i}" for i in range(len(self.values))]

    def _kernel_outputs(self, names) -> list[Variable]:
        """The arrays passed as outputs or, if there are none, those that the kernel writes."""
        if self.targets:
            return _variables(names[len(self.values) :], self.targets)
        kernel = self.function
        native = kernel.specialize(self.values) if kernel.is_generic else kernel.prepare()
        leaves = _leaves(names, self.values)
        written = signature_of(kernel, native, self.values).written
        return [leaves[i] for i in written if leaves[i] is not None]

    def run(self) -> list[Variable]:
        """Evaluates with the contents that the arrays have, and returns the outputs."""
        if self.is_kernel:
            launch(
                self.function,
                self.dim,
                self.values,
                self.targets,
                device=self._launch_device(),
                block_dim=self.block_dim or 0,
            )
        else:
            result = self.function(*self.values)
            if result is None:
                result = self.targets
            results = list(result) if isinstance(result, (list, tuple)) else [result]
            self.outputs = _variables([f"output_{i}" for i in range(len(results))], results)
        if not self.outputs:
            raise errors.WarpGradientError(
                f"no output of '{self.label}' has a gradient",
                hint="make output arrays with `requires_grad=True`",
            )
        return self.outputs

    def _launch_device(self):
        if self.device is not None:
            return self.device
        arrays = self._all_arrays()
        return arrays[0].device if arrays else None

    def reset(self) -> None:
        """Gives the arrays the contents that they had at first."""
        with Observing(tape=None):
            for one, contents in self._saved:
                one.assign(contents)

    def _restore(self):
        if self.restore_at_end:
            self.reset()

    def pairs(self, mask) -> list[tuple[Variable, Variable]]:
        """Inputs and outputs to be compared: all, or those that the mask names."""
        chosen = [
            (source, target)
            for source in self.inputs
            for target in self.outputs
            if mask is None
            or any(_is(source, first) and _is(target, second) for first, second in mask)
        ]
        if not chosen:
            known = ", ".join(f"'{one.name}'" for one in (*self.inputs, *self.outputs))
            raise ValueError(f"input_output_mask names no pair of {known}")
        return chosen


def _is(variable, key) -> bool:
    return key in (variable.key, variable.name)


def _leaves(names, values) -> list[Variable | None]:
    """A variable for each array among the values, None for those without gradient."""
    found: list = []
    for position, value in enumerate(values):
        name = names[position] if position < len(names) else f"input_{position}"
        value = struct_of(value)
        if isinstance(value, StructInstance):
            named = [(path, path, one) for path, one in struct_leaves(name, value)]
        elif isinstance(value, array):
            named = [(position, name, value)]
        else:
            continue
        for key, label, one in named:
            usable = one is not None and one.requires_grad and is_real(one.dtype)
            found.append(Variable(key, label, one) if usable else None)
    return found


def _variables(names, values) -> list[Variable]:
    return [one for one in _leaves(names, values) if one is not None]


def is_real(dtype) -> bool:
    """True if elements are made of floating-point numbers that NumPy has."""
    if dtypes.is_struct(dtype):
        return False
    scalar = getattr(dtype, "_wp_scalar_type_", dtype)
    return issubclass(scalar, scalars.float_base) and scalar is not scalars.bfloat16


def numbers_of(one: array) -> numpy.ndarray:
    """The scalars of an array in row-major order, copied."""
    return numpy.array(one.contiguous().numpy(), copy=True).reshape(-1)


def set_numbers(one: array, numbers: numpy.ndarray) -> None:
    """Sets the scalars of an array."""
    inner = getattr(one.dtype, "_shape_", ())
    one.assign(array(numbers.reshape(one.shape + tuple(inner)), dtype=one.dtype, device="cpu"))
