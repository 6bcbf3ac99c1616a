"""Common parts of kernels and Python functions as functions of JAX: parameters and results.

`Parameters` holds the names and types of the parameters and which of them are inputs, outputs or
both; a `Plan` is one traced call: its buffers, results, and which of them each parameter is.
"""

from __future__ import annotations

from warp._src import errors
from warp._src.interop import jax_axes
from warp._src.interop.jax import dtype_from_jax, dtype_to_jax
from warp._src.types import dtypes

_MOST = 2**31 - 1


def extents_of(dims) -> tuple:
    """One extent or several as a tuple."""
    return (int(dims),) if hasattr(dims, "__index__") else tuple(map(int, dims))


class Parameter:
    """A parameter: an array with its rank, scalar type and inner extents, or a value."""

    def __init__(self, name, dtype=None, rank=0):
        self.name, self.rank, self.dtype = name, rank, dtype
        self.is_array = dtype is not None
        # Arrays of structs have no counterpart in JAX, and structs may hold arrays.
        self.holds_arrays = self.is_array and dtypes.is_struct(dtype)
        if self.is_array:
            self.scalar = getattr(dtype, "_wp_scalar_type_", dtype)
            self.inner = tuple(getattr(dtype, "_shape_", ()))

    @property
    def has_derivative(self) -> bool:
        """True if it is an array of floats."""
        return self.is_array and self.scalar in dtypes.FLOAT_TYPES

    def result(self, jax, shape, message, buffers):
        """The description for JAX of an array that a call gives for some buffers."""
        dtype = jax.numpy.dtype(dtype_to_jax(self.scalar))
        if jax.dtypes.canonicalize_dtype(dtype) != dtype:
            raise TypeError(
                message(
                    f"output '{self.name}' of '{self.scalar.__name__}' needs "
                    f"`jax.config.update('jax_enable_x64', True)`"
                )
            )
        return jax_axes.describe(jax, shape + self.inner, dtype, buffers)

    def checked(self, jax, value, message):
        """A JAX array that fits the parameter."""
        if not hasattr(value, "aval"):
            value = jax.numpy.asarray(value)
        rank = self.rank + len(self.inner)
        fits = value.ndim == rank and tuple(value.shape[self.rank :]) == self.inner
        if not fits or dtype_from_jax(value.dtype) is not self.scalar:
            after = f" and inner dimensions {self.inner}" if self.inner else ""
            raise TypeError(
                message(
                    f"argument '{self.name}' expects {rank} dimensions of "
                    f"'{self.scalar.__name__}'{after}, but got shape "
                    f"{tuple(value.shape)} of '{value.dtype}'"
                )
            )
        return value


class Arguments:
    """Names of the parameters, how many of them are inputs, and how errors begin.

    Raises:
        ValueError: numbers or names do not fit the function.
    """

    def __init__(self, what, key, names, num_outputs, in_out_argnames):
        self.what, self.key, self.names, self.num_outputs = what, key, names, num_outputs
        given = tuple(in_out_argnames or ())
        self.in_outs = frozenset(given)
        count = len(names)
        if not 0 < num_outputs <= count or self.in_outs - set(names):
            unknown = self.in_outs - set(names)
            raise errors.WarpLaunchValueError(
                self.message(
                    f"expects 1 to {count} outputs and in-out arguments "
                    f"of {names}, but got {num_outputs} and {given}"
                ),
                code="in-out-unknown",
                facts={"unknown": unknown},
            )
        if len(given) != len(self.in_outs):
            raise errors.WarpLaunchValueError(
                self.message(f"got in-out arguments twice in {given}"),
                code="in-out-twice",
            )
        if len(given) > num_outputs:
            raise errors.WarpLaunchValueError(
                self.message(
                    f"expects `num_outputs` to count the {len(given)} in-out arguments, "
                    f"but got {num_outputs}"
                )
            )
        self.num_inputs = count - num_outputs + len(given)
        late = self.in_outs & set(names[self.num_inputs :])
        if late:
            raise errors.WarpLaunchValueError(
                self.message(f"in-out arguments come before outputs, but {sorted(late)} does not"),
                code="in-out-late",
            )

    def message(self, text) -> str:
        return f"{self.what}('{self.key}'): {text}"

    def check_kinds(self, parameters) -> None:
        """Checks that outputs are arrays, and arrays of numbers.

        Raises:
            TypeError: one is not.
        """
        for position, parameter in enumerate(parameters):
            written = position >= self.num_inputs or parameter.name in self.in_outs
            if written and not parameter.is_array:
                raise TypeError(self.message(f"expects an array as output '{parameter.name}'"))
            if parameter.holds_arrays:
                raise TypeError(
                    self.message(f"structs with arrays cannot be passed, as '{parameter.name}'")
                )

    def check_writes(self, parameters, accesses) -> None:
        """Checks that a kernel leaves its inputs alone, which JAX takes for immutable.

        Args:
            accesses: (loaded, stored, combined, fetched, line) of each array.

        Raises:
            ValueError: it may write one.
        """
        arrays = [found for found in enumerate(parameters) if found[1].is_array]
        for (position, parameter), access in zip(arrays, accesses, strict=True):
            written = position >= self.num_inputs or parameter.name in self.in_outs
            if not written and (access[1] or access[2]):
                where = f" in line {access[4]}" if access[4] else ""
                raise errors.WarpLaunchValueError(
                    self.message(
                        f"argument '{parameter.name}' is an input, which JAX takes for immutable, "
                        f"but the kernel may write it{where}; name it in `in_out_argnames`"
                    )
                )

    def check_values(self, jax, parameters, args):
        """The inputs, arrays among them checked, and the shapes of these by name."""
        inputs = parameters[: self.num_inputs]
        if len(args) != len(inputs):
            raise TypeError(self.message(f"expects {len(inputs)} arguments, but got {len(args)}"))
        values = [
            parameter.checked(jax, value, self.message) if parameter.is_array else value
            for parameter, value in zip(inputs, args, strict=True)
        ]
        shapes = {
            parameter.name: tuple(value.shape[: parameter.rank])
            for parameter, value in zip(inputs, values, strict=True)
            if parameter.is_array
        }
        for name, shape in shapes.items():
            self._check_extents(f"extents of '{name}'", shape)
        return values, shapes

    def _check_extents(self, what, shape) -> None:
        for axis, extent in enumerate(shape):
            if extent > _MOST:
                raise errors.WarpLaunchValueError(
                    self.message(f"{what} must be below 2^31, but got {shape}"),
                    code="jax-extent",
                    facts={"extent": extent, "axis": axis},
                )

    def launch_dims(self, dims, shapes) -> tuple:
        """The extents given, or those of the first array."""
        if dims is None:
            if not shapes:
                raise ValueError(self.message("expects `launch_dims`, there is no input array"))
            dims = next(iter(shapes.values()))
        extents = extents_of(dims)
        self._check_extents("extents of the launch", extents)
        return extents

    def add_outputs(self, shapes, parameters, wanted, dims) -> None:
        """Adds the shapes of pure outputs.

        They are what is wanted, else the extents of the launch, or where these are too few or too
        many, the shape of the first input array that has as many.
        """
        inputs = list(shapes.values())
        for parameter in parameters[self.num_inputs :]:
            shape = wanted
            if isinstance(wanted, dict):
                if parameter.name not in wanted:
                    raise ValueError(
                        self.message(f"expects a shape for '{parameter.name}' in `output_dims`")
                    )
                shape = extents_of(wanted[parameter.name])
                inner = parameter.inner
                if inner and len(shape) > parameter.rank and shape[parameter.rank :] == inner:
                    shape = shape[: parameter.rank]
            if shape is None and len(dims) != parameter.rank:
                shape = next((one for one in inputs if len(one) == parameter.rank), None)
            shape = dims if shape is None else extents_of(shape)
            if len(shape) != parameter.rank:
                raise ValueError(
                    self.message(
                        f"output '{parameter.name}' expects {parameter.rank} dimensions, "
                        f"but got shape {shape}, use `output_dims`"
                    )
                )
            shapes[parameter.name] = shape


class Plan:
    """The parameters of a call by its buffers.

    Attributes:
        buffers: the arrays that are passed.
        results: the parameters that are returned.
        aliases: results by the number of the buffer that they share memory with.
        entries: for each parameter its value, or whether it is a result, the number and the shape.
    """

    def __init__(self, parameters, values, shapes, arguments):
        import jax

        self.buffers, self.results, self.aliases, self.entries = [], [], {}, []
        num_inputs, in_outs = arguments.num_inputs, arguments.in_outs
        for position, parameter in enumerate(parameters):
            if not parameter.is_array:
                value = values[position]
                if isinstance(value, jax.core.Tracer):
                    text = f"argument '{parameter.name}' must be known while tracing"
                    raise TypeError(arguments.message(text))
                if isinstance(value, jax.Array):
                    value = value.item() if value.ndim == 0 else value.tolist()
                self.entries.append((value,))
                continue
            written = position >= num_inputs or parameter.name in in_outs
            if written and position < num_inputs:
                self.aliases[len(self.buffers)] = len(self.results)
            place = len(self.results if written else self.buffers)
            self.entries.append((written, place, shapes[parameter.name]))
            if position < num_inputs:
                self.buffers.append(values[position])
            if written:
                self.results.append(parameter)
        self.buffers = jax_axes.vary_alike(jax, self.buffers)

    def results_for(self, jax, shapes, message) -> list:
        """The results for JAX; they vary over the axes of meshes as the inputs do."""
        return [one.result(jax, shapes[one.name], message, self.buffers) for one in self.results]
