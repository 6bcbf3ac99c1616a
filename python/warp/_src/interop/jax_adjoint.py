"""Derivatives of kernels for JAX: `wp.jax_kernel(enable_backward=True)`."""

from __future__ import annotations

from warp._src.arrays.copies import clone
from warp._src.interop import jax_arrays, jax_axes
from warp._src.kernels.launch import launch


def differentiable(owner, parameters, plan, dims, call):
    """The call of a kernel as a function of its arrays that JAX can differentiate.

    The adjoint of the kernel gets the inputs, the outputs and their cotangents, and gives the
    cotangents of the inputs that are floats; others have none.

    Args:
        call: the call without derivatives, of the arrays.
    """
    import jax
    import numpy

    jax_arrays.register()
    inputs = [one for one in parameters[: owner.arguments.num_inputs] if one.is_array]
    active = [i for i, one in enumerate(inputs) if one.has_derivative]
    adjoint = _Adjoint(owner.kernel, parameters, plan, dims, owner.block_dim)
    number = jax_arrays.add_callback(adjoint.text, adjoint)

    @jax.custom_vjp
    def function(*arrays):
        return call(*arrays)

    def forward(*arrays):
        results = call(*arrays)
        return results, (arrays, results)

    def backward(kept, cotangents):
        arrays, results = kept
        given = jax_axes.vary_alike(jax, [*arrays, *results, *cotangents])
        described = [
            jax_axes.describe(jax, arrays[i].shape, arrays[i].dtype, given) for i in active
        ]
        gradients = jax.ffi.ffi_call(jax_arrays.TARGET, described, vmap_method=owner.vmap_method)(
            *given, call=numpy.int64(number)
        )
        found: list = [numpy.zeros(one.shape, jax.dtypes.float0) for one in arrays]
        for i, gradient in zip(active, gradients, strict=True):
            found[i] = gradient
        return tuple(found)

    function.defvjp(forward, backward)
    return function(*plan.buffers)


class _Adjoint:
    """The XLA call for the derivative of a call."""

    def __init__(self, kernel, parameters, plan, dims, block_dim):
        self.kernel, self.dims, self.block_dim = kernel, dims, block_dim
        self.entries = plan.entries
        self.arrays = [i for i, entry in enumerate(plan.entries) if len(entry) > 1]
        layout = {
            i: jax_arrays.Buffer(parameters[i].dtype, plan.entries[i][2]) for i in self.arrays
        }
        self.inputs = [i for i in self.arrays if not plan.entries[i][0]]
        self.outputs = [i for i in self.arrays if plan.entries[i][0]]
        self.active = [i for i in self.inputs if parameters[i].has_derivative]
        self.layout = [
            layout[i] for i in (*self.inputs, *self.outputs, *self.outputs, *self.active)
        ]
        shown = [(one.name, one.dtype, one.rank) for one in parameters]
        text = kernel.prepare().ir("warp")
        self.text = f"adjoint {text} {kernel.options} {shown} {plan.entries} {dims} {block_dim}"

    def __call__(self, index, stream, arguments, results) -> None:
        with jax_arrays.Place(index, stream) as place:
            for addresses in jax_arrays.entries(self.layout, [*arguments, *results]):
                self._run(place, addresses)

    def _run(self, place, addresses) -> None:
        made = [
            buffer.array(address, place.device)
            for buffer, address in zip(self.layout, addresses, strict=True)
        ]
        groups = []
        for names in (self.inputs, self.outputs, self.outputs, self.active):
            groups.append(dict(zip(names, made[: len(names)], strict=True)))
            made = made[len(names) :]
        inputs, outputs, cotangents, targets = groups
        values = [
            entry[0] if i not in self.arrays else inputs[i] if i in inputs else outputs[i]
            for i, entry in enumerate(self.entries)
        ]
        gradients: list = [None] * len(values)
        for i, cotangent in cotangents.items():
            # The adjoint may change it, and what is JAX's must not be.
            gradients[i] = clone(cotangent)
        for i, target in targets.items():
            target.zero_()
            gradients[i] = target
        launch(
            self.kernel,
            self.dims,
            values,
            adj_inputs=gradients,
            device=place.device,
            adjoint=True,
            block_dim=self.block_dim,
        )
