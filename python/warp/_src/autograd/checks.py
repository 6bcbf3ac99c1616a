"""`gradcheck`: adjoints against central differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy

from warp._src import errors
from warp._src.argument_kinds import CALLABLE, DICT, INTEGER, LIST, NAMES, NUMBER, TAPE
from warp._src.arguments import checked
from warp._src.autograd.evaluation import Evaluation
from warp._src.autograd.jacobians import difference_columns, reverse_rows
from warp._src.derivatives.tape_records import LaunchRecord
from warp._src.devices.devices import by_index
from warp._src.kernels.kernel import Kernel


@checked(
    function=CALLABLE,
    inputs=LIST,
    outputs=LIST,
    input_output_mask=LIST,
    rtol=NUMBER,
    max_blocks=INTEGER,
    max_inputs_per_var=INTEGER,
    max_outputs_per_var=INTEGER,
)
def gradcheck(
    function: Kernel | Callable,
    dim=None,
    inputs: Sequence | None = None,
    outputs: Sequence | None = None,
    *,
    eps: float = 1e-4,
    atol: float = 1e-3,
    rtol: float = 1e-2,
    raise_exception: bool = True,
    input_output_mask: list[tuple[str | int, str | int]] | None = None,
    device=None,
    max_blocks: int = 0,
    block_dim: int | None = None,
    max_inputs_per_var: int = -1,
    max_outputs_per_var: int = -1,
    plot_relative_error: bool = False,
    plot_absolute_error: bool = False,
    show_summary: bool = True,
    restore_inputs: bool = True,
) -> bool:
    """Compares Jacobians by reverse mode with central differences.

    Args:
        function: a kernel, or a Python function that launches kernels.
        dim, inputs, outputs, input_output_mask, device, block_dim: as for `jacobian`.
        eps: step of the differences.
        atol, rtol: the difference may be `atol + rtol * |central difference|`.
        raise_exception: raise an error if it is larger anywhere.
        max_inputs_per_var, max_outputs_per_var: scalars of each input and output to do.
        plot_relative_error, plot_absolute_error: show pictures of the difference.
        show_summary: print a line for each pair of input and output.
        restore_inputs: give the arrays their contents back.

    Returns:
        True if all agree.

    Raises:
        WarpGradientMismatch: they don't.
    """
    with Evaluation(
        function, dim, inputs, outputs, device, block_dim, None, restore_inputs
    ) as problem:
        adjoint = reverse_rows(problem, input_output_mask, max_outputs_per_var)
        central = difference_columns(problem, input_output_mask, max_inputs_per_var, eps)
        names = {one.key: one.name for one in problem.inputs}
        targets = {one.key: one.name for one in problem.outputs}
    lines, failed = [], []
    for key, computed in adjoint.items():
        pair = names[key[0]], targets[key[1]]
        line, agrees = _compare(pair, computed, central[key], atol, rtol)
        lines.append(line)
        if not agrees:
            failed.append(line)
    _plot(problem, adjoint, central, plot_absolute_error, plot_relative_error)
    if show_summary:
        print(f"gradients of '{problem.label}': {'differ' if failed else 'agree'}")
        print("\n".join(f"  {line}" for line in lines))
    if failed and raise_exception:
        raise errors.WarpGradientMismatch(
            f"gradients of '{problem.label}' differ from central differences",
            notes=tuple(failed),
        )
    return not failed


def _compare(names, computed, central, atol, rtol) -> tuple[str, bool]:
    """A line about one Jacobian, and whether it passes."""
    known = ~(numpy.isnan(central) & _skipped(central)) & ~_skipped_rows(computed)
    pair = f"d{names[1]}/d{names[0]}"
    if not known.any():
        return f"{pair}: nothing compared", True
    with numpy.errstate(invalid="ignore"):
        error = numpy.abs(computed.astype(numpy.float64) - central)
        bad = known & ~(error <= atol + rtol * numpy.abs(central))
    error = numpy.where(known, error, 0.0)
    error[known & numpy.isnan(error)] = numpy.inf
    place = tuple(int(i) for i in numpy.unravel_index(numpy.argmax(error), error.shape))
    scale = max(abs(float(central[place])), abs(float(computed[place])), 1e-300)
    text = (
        f"{pair}: largest difference {error[place]:.3e} at {place}, "
        f"{error[place] / scale:.1e} of the value "
        f"(adjoint {computed[place]:.6g}, central difference {central[place]:.6g})"
    )
    return text + (", differs" if bad.any() else ""), not bad.any()


def _skipped(central) -> numpy.ndarray:
    """Columns that were left out."""
    return numpy.broadcast_to(numpy.isnan(central).all(axis=0), central.shape)


def _skipped_rows(computed) -> numpy.ndarray:
    """Rows that were left out."""
    return numpy.broadcast_to(numpy.isnan(computed).all(axis=1)[:, None], computed.shape)


def _plot(problem, computed, central, absolute, relative) -> None:
    if not (absolute or relative):
        return
    from warp._src.autograd.plots import metadata_of, show_matrices

    names = metadata_of(problem.metadata or problem.function, problem.values)
    differences = {key: numpy.abs(found - central[key]) for key, found in computed.items()}
    title = f"{problem.label} kernel Jacobian"
    if relative:
        scaled = {
            key: error / (numpy.abs(central[key]) + 1e-12) for key, error in differences.items()
        }
        show_matrices(scaled, names, f"{title} relative error")
    if absolute:
        show_matrices(differences, names, f"{title} absolute error")


@checked(
    tape=TAPE,
    rtol=NUMBER,
    input_output_masks=DICT,
    blacklist_kernels=NAMES,
    whitelist_kernels=NAMES,
    max_inputs_per_var=INTEGER,
    max_outputs_per_var=INTEGER,
    skip_to_launch_index=INTEGER,
)
def gradcheck_tape(
    tape,
    *,
    eps: float = 1e-4,
    atol: float = 1e-3,
    rtol: float = 1e-2,
    raise_exception: bool = True,
    input_output_masks: dict[str, list[tuple[str | int, str | int]]] | None = None,
    blacklist_kernels: list[str] | None = None,
    whitelist_kernels: list[str] | None = None,
    max_inputs_per_var: int = -1,
    max_outputs_per_var: int = -1,
    plot_relative_error: bool = False,
    plot_absolute_error: bool = False,
    show_summary: bool = True,
    reverse_launches: bool = False,
    skip_to_launch_index: int = 0,
) -> bool:
    """Runs `gradcheck` for each launch on a tape, with the contents that the arrays have now.

    Launches of kernels with `enable_backward=False` are left out.

    Args:
        tape: whose launches.
        input_output_masks: `input_output_mask` by name of the kernel.
        blacklist_kernels: names of kernels to leave out.
        whitelist_kernels: names of the only kernels to check.
        reverse_launches: begin with the last launch.
        skip_to_launch_index: launches to leave out at the beginning.

    Returns:
        True if all agree.

    Raises:
        WarpGradientMismatch: a launch does not.
    """
    launches = [record.call for record in tape.launches if isinstance(record, LaunchRecord)]
    if reverse_launches:
        launches.reverse()
    passed = True
    for call in launches[skip_to_launch_index:]:
        name = call.kernel.key
        if not call.kernel.option("enable_backward"):
            continue
        if name in (blacklist_kernels or ()) or name not in (whitelist_kernels or [name]):
            continue
        try:
            passed &= gradcheck(
                call.kernel,
                call.dim,
                list(call.values),
                None,
                eps=eps,
                atol=atol,
                rtol=rtol,
                raise_exception=raise_exception,
                input_output_mask=(input_output_masks or {}).get(name),
                device=_device(call),
                block_dim=call.block_dim,
                max_inputs_per_var=max_inputs_per_var,
                max_outputs_per_var=max_outputs_per_var,
                plot_relative_error=plot_relative_error,
                plot_absolute_error=plot_absolute_error,
                show_summary=show_summary,
            )
        except errors.WarpGradientMismatch as error:
            error.notes = (*error.notes, f"in the {call.event}")
            raise
    return passed


def _device(call):
    return by_index(call.device)
