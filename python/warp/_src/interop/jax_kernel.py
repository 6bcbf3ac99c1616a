"""`wp.jax_kernel`: kernels as functions of JAX, under `jit` and `vmap` too.

While JAX traces a call, the launch is entered into a table of the native module, under a number
made from everything that it consists of: code, extents, scalar arguments. The traced program only
carries that number; XLA passes it to native code together with the buffers. Because the number
comes from the contents, JAX may also keep compiled programs on disk.
"""

from __future__ import annotations

import functools
import operator

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import COUNT, DIM, DIMS, NAMES, TEXT
from warp._src.arguments import checked
from warp._src.interop import jax_arrays
from warp._src.interop.jax_callable import JaxModulePreloadMode, preload
from warp._src.interop.jax_calls import Arguments, Parameter, Plan, extents_of
from warp._src.interop.jax_launch import Launch
from warp._src.interop.packages import load
from warp._src.kernels.kernel import Kernel
from warp._src.types import dtypes

TARGET = "warp_mlir_kernel"
_CODE_OPTIONS = ("mode", "fast_math", "lineinfo", "optimization_level", "block_dim")


@functools.cache
def _register() -> None:
    """Makes the native functions known to XLA."""
    jax = load("jax")

    on_cpu, on_cuda = _native.xla_handlers()
    jax.ffi.register_ffi_target(TARGET, on_cpu, platform="cpu")
    jax.ffi.register_ffi_target(TARGET, on_cuda, platform="CUDA")


@checked(
    num_outputs=COUNT,
    vmap_method=TEXT,
    launch_dims=DIM,
    in_out_argnames=NAMES,
    output_dims=DIMS,
)
def jax_kernel(
    kernel,
    num_outputs=1,
    vmap_method="broadcast_all",
    launch_dims=None,
    output_dims=None,
    in_out_argnames=None,
    module_preload_mode=JaxModulePreloadMode.CURRENT_DEVICE,
    enable_backward=False,
    has_side_effect=False,
    block_dim=None,
):
    """Makes a function of JAX arrays from a kernel.

    The kernel's array parameters are inputs first, then outputs. The function takes the inputs: JAX
    arrays for arrays, and values known while tracing for the rest. It returns the list of outputs.
    The same arguments give the same object.

    Args:
        kernel: a kernel without generic parameters.
        num_outputs: number of output arrays, those of `in_out_argnames` among them.
        vmap_method: how `jax.vmap` applies, see `jax.ffi.ffi_call`. The kernel runs once for each
            entry of the batch.
        launch_dims: extent or extents of the launch, by default the shape of the first array.
        output_dims: shape of the outputs, or a dictionary of shapes by parameter name; by default
            `launch_dims`. Elements that the kernel does not write are undefined.
        in_out_argnames: names of array parameters that are input and output.
        module_preload_mode: see `JaxModulePreloadMode`.
        enable_backward: `jax.grad` and `jax.vjp` work: the adjoint of the kernel gives gradients of
            the arrays of floats among the inputs. Needs pure outputs.
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
    block_dim = _checked_block(block_dim)
    options = (num_outputs, vmap_method, _frozen(launch_dims), _frozen(output_dims))
    options += (tuple(in_out_argnames or ()), has_side_effect, block_dim, bool(enable_backward))
    if not isinstance(kernel, Kernel):
        raise TypeError(f"jax_kernel: expects a kernel, but got '{type(kernel).__name__}'")
    known = kernel.__dict__.setdefault("functions_of_jax", {})
    if options not in known:
        given = (num_outputs, vmap_method, launch_dims, output_dims)
        known[options] = JaxKernel(kernel, *given, *options[4:])
    if module_preload_mode == JaxModulePreloadMode.ALL_DEVICES:
        preload(kernel.module)
    return known[options]


def _checked_block(block_dim):
    if block_dim is None:
        return None
    if isinstance(block_dim, bool) or not hasattr(block_dim, "__index__"):
        raise TypeError(f"block_dim must be an integer or None, but got {block_dim!r}")
    if block_dim <= 0:
        raise ValueError(f"block_dim must be positive, but got {block_dim}")
    return operator.index(block_dim)


def _frozen(dims):
    if isinstance(dims, dict):
        return tuple((name, extents_of(shape)) for name, shape in dims.items())
    return None if dims is None else extents_of(dims)


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
        enable_backward,
    ):
        if kernel.is_generic:
            raise TypeError(f"jax_kernel('{kernel.key}'): the kernel has generic parameters")
        self.kernel = kernel
        self.vmap_method = vmap_method
        self.launch_dims = launch_dims
        self.output_dims = output_dims
        self.has_side_effect = has_side_effect
        self.enable_backward = enable_backward
        self.block_dim = block_dim
        self._code = (None, None)
        names = kernel.func.__code__.co_varnames[: kernel.func.__code__.co_argcount]
        self.arguments = Arguments("jax_kernel", kernel.key, names, num_outputs, in_out_argnames)
        if enable_backward and self.arguments.in_outs:
            raise errors.WarpLaunchValueError(
                self.arguments.message("`enable_backward` needs outputs that are no inputs")
            )

    def __call__(self, *args, launch_dims=None, output_dims=None, vmap_method=None):
        jax = load("jax")
        import numpy

        _register()
        native, arguments = self.kernel.prepare(), self.arguments
        parameters = [_parameter(*found) for found in native.parameters]
        arguments.check_kinds(parameters)
        arguments.check_writes(parameters, native.accesses)
        values, shapes = arguments.check_values(jax, parameters, args)
        dims = launch_dims if launch_dims is not None else self.launch_dims
        dims = arguments.launch_dims(dims, shapes)
        wanted = output_dims if output_dims is not None else self.output_dims
        arguments.add_outputs(shapes, parameters, wanted, dims)
        plan = Plan(parameters, values, shapes, arguments)
        # Hooks choose the code by the device, which is not known yet.
        has_hooks = bool(self.kernel.hooks)
        call = jax.ffi.ffi_call(
            jax_arrays.RECORDABLE_TARGET if has_hooks else TARGET,
            plan.results_for(jax, shapes, arguments.message),
            vmap_method=vmap_method or self.vmap_method,
            input_output_aliases=plan.aliases,
            has_side_effect=self.has_side_effect,
        )
        if has_hooks:
            jax_arrays.register()
            made = Launch(self.kernel, parameters, plan, dims, self.block_dim)
            number = jax_arrays.add_callback(made.text, made)
        else:
            number = _native.xla_add_call(
                native,
                dims,
                plan.entries,
                self.block_dim or 0,
                lambda values: self._number(native, dims, plan, values),
            )
        call = functools.partial(call, call=numpy.int64(number))
        if self.enable_backward:
            from warp._src.interop.jax_adjoint import differentiable

            return differentiable(self, parameters, plan, dims, call)
        return call(*plan.buffers)

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


def _parameter(name, kind, type_text, offset, size, rank, element) -> Parameter:
    """The native kernel's record of one parameter."""
    if kind == "array":
        return Parameter(name, dtypes.dtype_of(element), rank)
    found = Parameter(name)
    found.holds_arrays = kind == "struct" and "!warp.array" in type_text
    return found
