"""`wp.jax_kernel`: kernels as functions of JAX, under `jit` and `vmap` too.

While JAX traces a call, the launch is entered into a table of the native module, under a number
made from everything that it consists of: code, extents, scalar arguments. The traced program only
carries that number; XLA passes it to native code together with the buffers. Because the number
comes from the contents, JAX may also keep compiled programs on disk.
"""

from __future__ import annotations

import functools

from warp import _native
from warp._src.interop.jax import dtype_from_jax, dtype_to_jax
from warp._src.kernels.kernel import Kernel
from warp._src.types import dtypes

TARGET = "warp_mlir_kernel"
_CODE_OPTIONS = ("mode", "fast_math", "lineinfo", "optimization_level", "block_dim")


@functools.cache
def _register() -> None:
    """Makes the native functions known to XLA."""
    import jax

    on_cpu, on_cuda = _native.xla_handlers()
    jax.ffi.register_ffi_target(TARGET, on_cpu, platform="cpu")
    jax.ffi.register_ffi_target(TARGET, on_cuda, platform="CUDA")


def jax_kernel(
    kernel,
    num_outputs=1,
    vmap_method="broadcast_all",
    launch_dims=None,
    output_dims=None,
    in_out_argnames=None,
    has_side_effect=False,
    block_dim=None,
):
    """Makes a function of JAX arrays from a kernel.

    The kernel's array parameters are inputs first, then outputs. The function takes the inputs: JAX
    arrays for arrays, and values known while tracing for the rest. It returns the list of outputs.

    Args:
        kernel: a kernel without generic parameters.
        num_outputs: number of output arrays, those of `in_out_argnames` among them.
        vmap_method: how `jax.vmap` applies, see `jax.ffi.ffi_call`. The kernel runs once for each
            entry of the batch.
        launch_dims: extent or extents of the launch, by default the shape of the first array.
        output_dims: shape of the outputs, or a dictionary of shapes by parameter name; by default
            `launch_dims`. Elements that the kernel does not write are undefined.
        in_out_argnames: names of array parameters that are input and output.
        has_side_effect: keep calls whose outputs nobody uses.
        block_dim: CUDA threads per block.

    `launch_dims`, `output_dims` and `vmap_method` can also be given per call.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def scale(x: wp.array(dtype=float), s: float, y: wp.array(dtype=float)):
        ...     i = wp.tid()
        ...     y[i] = s * x[i]
        >>> import jax
        >>> double = jax.jit(lambda x: wp.jax_kernel(scale)(x, 2.0)[0])

    Raises:
        TypeError, ValueError: the kernel cannot be used that way.
    """
    return JaxKernel(
        kernel,
        num_outputs,
        vmap_method,
        launch_dims,
        output_dims,
        in_out_argnames,
        has_side_effect,
        block_dim,
    )


def _extents(dims) -> tuple:
    return (int(dims),) if hasattr(dims, "__index__") else tuple(map(int, dims))


class JaxKernel:
    """A kernel as a function of JAX arrays, made by `wp.jax_kernel`."""

    def __init__(
        self,
        kernel,
        num_outputs,
        vmap_method,
        launch_dims,
        output_dims,
        in_out_argnames,
        has_side_effect,
        block_dim,
    ):
        if not isinstance(kernel, Kernel):
            raise TypeError(f"jax_kernel: expects a kernel, but got '{type(kernel).__name__}'")
        if kernel.is_generic:
            raise TypeError(f"jax_kernel('{kernel.key}'): the kernel has generic parameters")
        self.kernel = kernel
        self.num_outputs = num_outputs
        self.vmap_method = vmap_method
        self.launch_dims = launch_dims
        self.output_dims = output_dims
        self.in_outs = frozenset(in_out_argnames or ())
        self.has_side_effect = has_side_effect
        self.block_dim = block_dim or 0
        self._code = (None, None)
        count = kernel.func.__code__.co_argcount
        names = kernel.func.__code__.co_varnames[:count]
        if not 0 < num_outputs <= count or self.in_outs - set(names):
            raise ValueError(
                f"jax_kernel('{kernel.key}'): expects 1 to {count} outputs and in-out arguments "
                f"of {names}, but got {num_outputs} and {tuple(self.in_outs)}"
            )
        if len(self.in_outs) > num_outputs:
            raise ValueError(
                f"jax_kernel('{kernel.key}'): expects `num_outputs` to count the "
                f"{len(self.in_outs)} in-out arguments, but got {num_outputs}"
            )
        self.num_inputs = count - num_outputs + len(self.in_outs)

    def __call__(self, *args, launch_dims=None, output_dims=None, vmap_method=None):
        import jax
        import numpy

        _register()
        native = self.kernel.prepare()
        parameters = [_Parameter(*found) for found in native.parameters]
        inputs = parameters[: self.num_inputs]
        if len(args) != len(inputs):
            raise TypeError(self._message(f"expects {len(inputs)} arguments, but got {len(args)}"))
        self._check_kinds(parameters)
        values = [
            self._array(jax, parameter, value) if parameter.is_array else value
            for parameter, value in zip(inputs, args, strict=True)
        ]
        shapes = {
            parameter.name: tuple(value.shape[: parameter.rank])
            for parameter, value in zip(inputs, values, strict=True)
            if parameter.is_array
        }
        dims = self._launch_dims(launch_dims, shapes)
        self._add_outputs(shapes, parameters, output_dims, dims)
        plan = _Plan(parameters, values, shapes, self.in_outs, self.num_inputs, self._message)
        call = jax.ffi.ffi_call(
            TARGET,
            [self._result(jax, parameter, shapes[parameter.name]) for parameter in plan.results],
            vmap_method=vmap_method or self.vmap_method,
            input_output_aliases=plan.aliases,
            has_side_effect=self.has_side_effect,
        )
        number = _native.xla_add_call(
            native,
            dims,
            plan.entries,
            self.block_dim,
            lambda values: self._number(native, dims, plan, values),
        )
        return call(*plan.buffers, call=numpy.int64(number))

    def _message(self, text) -> str:
        return f"jax_kernel('{self.kernel.key}'): {text}"

    def _check_kinds(self, parameters) -> None:
        for position, parameter in enumerate(parameters):
            written = position >= self.num_inputs or parameter.name in self.in_outs
            if written and not parameter.is_array:
                raise TypeError(self._message(f"expects an array as output '{parameter.name}'"))
            if parameter.holds_arrays:
                raise TypeError(
                    self._message(f"structs with arrays cannot be passed, as '{parameter.name}'")
                )

    def _array(self, jax, parameter, value):
        """A JAX array, checked against the parameter."""
        if not hasattr(value, "aval"):
            value = jax.numpy.asarray(value)
        inner = parameter.inner
        rank = parameter.rank + len(inner)
        fits = value.ndim == rank and tuple(value.shape[parameter.rank :]) == inner
        if not fits or dtype_from_jax(value.dtype) is not parameter.scalar:
            after = f" and inner dimensions {inner}" if inner else ""
            raise TypeError(
                self._message(
                    f"argument '{parameter.name}' expects {rank} dimensions of "
                    f"'{parameter.scalar.__name__}'{after}, but got shape "
                    f"{tuple(value.shape)} of '{value.dtype}'"
                )
            )
        return value

    def _launch_dims(self, given, shapes) -> tuple:
        dims = given if given is not None else self.launch_dims
        if dims is None:
            if not shapes:
                raise ValueError(self._message("expects `launch_dims`, there is no input array"))
            dims = next(iter(shapes.values()))
        return _extents(dims)

    def _add_outputs(self, shapes, parameters, given, dims) -> None:
        """Adds the shapes of pure outputs."""
        wanted = given if given is not None else self.output_dims
        for parameter in parameters[self.num_inputs :]:
            shape = wanted
            if isinstance(wanted, dict):
                if parameter.name not in wanted:
                    raise ValueError(
                        self._message(f"expects a shape for '{parameter.name}' in `output_dims`")
                    )
                shape = wanted[parameter.name]
            shape = dims if shape is None else _extents(shape)
            if len(shape) != parameter.rank:
                raise ValueError(
                    self._message(
                        f"output '{parameter.name}' expects {parameter.rank} dimensions, "
                        f"but got shape {shape}, use `output_dims`"
                    )
                )
            shapes[parameter.name] = shape

    def _result(self, jax, parameter, shape):
        dtype = jax.numpy.dtype(dtype_to_jax(parameter.scalar))
        if jax.dtypes.canonicalize_dtype(dtype) != dtype:
            raise TypeError(
                self._message(
                    f"output '{parameter.name}' of '{parameter.scalar.__name__}' needs "
                    f"`jax.config.update('jax_enable_x64', True)`"
                )
            )
        return jax.ShapeDtypeStruct(shape + parameter.inner, dtype)

    def _number(self, native, dims, plan, values) -> int:
        """63 bits that stand for the launch; `values` are the packed arguments."""
        import hashlib

        if self._code[0] is not native:
            options = [self.kernel.option(name) for name in _CODE_OPTIONS]
            text = f"{native.ir('warp')} {self.kernel.options} {options} {self.block_dim}"
            self._code = (native, text.encode())
        arrays = [entry for entry in plan.entries if len(entry) > 1]
        digest = hashlib.blake2b(self._code[1], digest_size=8)
        digest.update(repr((dims, arrays)).encode())
        digest.update(values)
        return int.from_bytes(digest.digest(), "little") >> 1


class _Parameter:
    """What the native kernel says about one parameter."""

    def __init__(self, name, kind, type_text, offset, size, rank, element):
        self.name = name
        self.is_array = kind == "array"
        self.holds_arrays = kind == "struct" and "!warp.array" in type_text
        self.rank = rank
        if self.is_array:
            dtype = dtypes.dtype_of(element)
            self.scalar = getattr(dtype, "_wp_scalar_type_", dtype)
            self.inner = tuple(getattr(dtype, "_shape_", ()))
            # Arrays of structs have no counterpart in JAX.
            self.holds_arrays = dtypes.is_struct(dtype)


class _Plan:
    """Which buffer of the call is which parameter."""

    def __init__(self, parameters, values, shapes, in_outs, num_inputs, message):
        import jax

        self.buffers, self.results, self.aliases, self.entries = [], [], {}, []
        for position, parameter in enumerate(parameters):
            if not parameter.is_array:
                value = values[position]
                if isinstance(value, jax.core.Tracer):
                    raise TypeError(
                        message(f"argument '{parameter.name}' must be known while tracing")
                    )
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
