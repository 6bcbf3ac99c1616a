"""Numbers about the derivative of a kernel."""

from __future__ import annotations

from warp._src.argument_kinds import LIST
from warp._src.arguments import checked
from warp._src.kernels.kernel import Kernel

NAMES = (
    "tape_bytes",
    "tape_bytes_per_trip",
    "replay_loops",
    "atomics",
    "block_reductions",
    "shadowed",
)


@checked(inputs=LIST)
def adjoint_metrics(kernel: Kernel, inputs=None) -> dict[str, int]:
    """Costs of a kernel's adjoint.

    Args:
        kernel: the kernel; counted is the adjoint that was made last or, if there is none, that
            with gradients of all arrays.
        inputs: arguments that a generic kernel is specialised for.

    Returns:
        `tape_bytes` (memory per thread for values kept in loops), `tape_bytes_per_trip` (memory
        that is allocated for each iteration of loops with `tape="global"`), `replay_loops` (loops
        that are run again), `atomics` (atomic additions to gradients), `block_reductions`
        (additions of a block's threads that are joined first), `shadowed` (arrays with gradients).

    Raises:
        WarpCodegenError: the kernel cannot be differentiated.
    """
    if not isinstance(kernel, Kernel):
        raise TypeError(f"expects a kernel, but got '{type(kernel).__name__}'")
    made = kernel.derivatives.last_adjoint()
    if made is None or inputs is not None:
        native = kernel.specialize(inputs or ()) if kernel.is_generic else kernel.prepare()
        made = kernel.derivatives.adjoint(native, (True,) * len(native.accesses))
    return {**dict.fromkeys(NAMES, 0), **made.metrics}
