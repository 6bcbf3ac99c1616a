"""Launches that Python makes when XLA calls: of kernels whose blocks work together."""

from __future__ import annotations

from warp._src.interop import jax_arrays
from warp._src.kernels.launch import launch


class Launch:
    """The XLA call for a launch of a kernel with tiles, which depends on the device.

    Attributes:
        text: what the launch consists of.
    """

    def __init__(self, kernel, parameters, plan, dims, block_dim):
        self.kernel, self.dims, self.block_dim = kernel, dims, block_dim
        self.entries = plan.entries
        self.arrays = [i for i, entry in enumerate(plan.entries) if len(entry) > 1]
        self.layout = [
            jax_arrays.Buffer(parameters[i].dtype, plan.entries[i][2]) for i in self.arrays
        ]
        shown = [(one.name, one.dtype, one.rank) for one in parameters]
        text = kernel.prepare().ir("warp")
        self.text = f"launch {text} {kernel.options} {shown} {plan.entries} {dims} {block_dim}"

    def __call__(self, index, stream, arguments, results) -> None:
        given = [
            (results if self.entries[i][0] else arguments)[self.entries[i][1]] for i in self.arrays
        ]
        with jax_arrays.Place(index, stream) as place:
            for addresses in jax_arrays.entries(self.layout, given):
                made = {
                    i: one.array(address, place.device)
                    for i, one, address in zip(self.arrays, self.layout, addresses, strict=True)
                }
                values = [made.get(i, entry[0]) for i, entry in enumerate(self.entries)]
                launch(
                    self.kernel, self.dims, values, device=place.device, block_dim=self.block_dim
                )
