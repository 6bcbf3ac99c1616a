"""Pictures of Jacobians with Matplotlib, which is imported when one is asked for."""

from __future__ import annotations

import inspect

import numpy

from warp._src.argument_kinds import CALLABLE, DICT, LIST, TEXT, instance
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.autograd.evaluation import FunctionMetadata
from warp._src.kernels.kernel import Kernel

_METADATA = instance(FunctionMetadata, "FunctionMetadata")


@checked(jacobians=DICT, kernel=CALLABLE | _METADATA, inputs=LIST, colormap=TEXT)
def jacobian_plot(
    jacobians: dict[tuple[int, int], array],
    kernel,
    inputs=None,
    show_plot: bool = True,
    show_colorbar: bool = True,
    scale_colors_per_submatrix: bool = False,
    title: str | None = None,
    colormap: str = "coolwarm",
    log_scale: bool = False,
):
    """Draws Jacobians as an array of pictures, a row per output and a column per input.

    Args:
        jacobians: what `jacobian` returned.
        kernel: the kernel or function, or `FunctionMetadata`, for names.
        inputs: the arguments of a kernel that are not outputs.
        show_plot: open a window.
        show_colorbar: draw the scale of colours.
        scale_colors_per_submatrix: let each picture have a scale of its own.
        title: headline, by default the function's name.
        colormap: Matplotlib's name of the colours.
        log_scale: colours by the logarithm of the absolute value.

    Returns:
        The Matplotlib figure, None if there is no Jacobian.

    Raises:
        ValueError: a kernel comes without `inputs`, or an input or output has no name.
    """
    metadata = metadata_of(kernel, inputs)
    if not jacobians:
        return None
    return show_matrices(
        {key: _matrix(values) for key, values in jacobians.items()},
        metadata,
        title or f"{metadata.key or 'unknown'} kernel Jacobian",
        show=show_plot,
        colorbar=show_colorbar,
        separate=scale_colors_per_submatrix,
        colormap=colormap,
        logarithmic=log_scale,
    )


def metadata_of(kernel, inputs=None) -> FunctionMetadata:
    """Names of a kernel or function, its inputs and its outputs."""
    if isinstance(kernel, FunctionMetadata):
        return kernel
    if not isinstance(kernel, Kernel):
        names = list(inspect.signature(kernel).parameters)
        return FunctionMetadata(getattr(kernel, "__name__", None), names)
    if inputs is None:
        raise ValueError("inputs must be provided to tell the inputs of a kernel from its outputs")
    code = kernel.func.__code__
    names = list(code.co_varnames[: code.co_argcount])
    # Where outputs are among the inputs, they have the same names.
    return FunctionMetadata(kernel.key, names, names[len(inputs) :] or names)


def _matrix(values) -> numpy.ndarray:
    numbers = values.numpy()
    return numbers.reshape(numbers.shape[0], -1)


def _label(labels, key, kind, default=None) -> str:
    """Name of an input or output; that of an array in a struct is its key."""
    if isinstance(key, str):
        return key
    known = dict(labels) if isinstance(labels, dict) else dict(enumerate(labels or ()))
    label = known.get(key, default)
    if label is None:
        raise ValueError(f"Jacobian {kind} index {key}: missing label, there are {len(known)}")
    return label


def _in_order(keys) -> list:
    return sorted(set(keys), key=lambda key: (isinstance(key, str), key))


def show_matrices(
    matrices: dict,
    metadata: FunctionMetadata,
    title: str,
    show: bool = True,
    colorbar: bool = True,
    separate: bool = False,
    colormap: str = "coolwarm",
    logarithmic: bool = False,
):
    """Draws matrices, by input and output, as coloured squares; extents are to scale."""
    import matplotlib.pyplot as plt

    columns, rows = _in_order(key[0] for key in matrices), _in_order(key[1] for key in matrices)
    named = metadata.output_labels is not None
    tops = [_label(metadata.input_labels, key, "input") for key in columns]
    sides = [
        _label(metadata.output_labels, key, "output", None if named else f"output_{key}")
        for key in rows
    ]
    figure, axes = plt.subplots(
        len(rows),
        len(columns),
        squeeze=False,
        layout="constrained",
        width_ratios=[max(m.shape[1] for k, m in matrices.items() if k[0] == c) for c in columns],
        height_ratios=[max(m.shape[0] for k, m in matrices.items() if k[1] == r) for r in rows],
    )
    if logarithmic:
        matrices = {key: numpy.log10(numpy.abs(m) + 1e-30) for key, m in matrices.items()}
    limits = {} if separate else _limits(matrices.values(), logarithmic)
    image = None
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            if (column, row) not in matrices:
                axes[i][j].axis("off")
                continue
            image = axes[i][j].imshow(matrices[column, row], cmap=colormap, aspect="auto", **limits)
            axes[i][j].set_xlabel(tops[j])
            axes[i][j].set_ylabel(sides[i])
            if colorbar and separate:
                figure.colorbar(image, ax=axes[i][j])
    if colorbar and not separate:
        figure.colorbar(image, ax=axes)
    figure.suptitle(title)
    if show:
        plt.show()
    return figure


def _limits(matrices, logarithmic) -> dict:
    """One scale of colours for all; without logarithms 0 has the middle one."""
    finite = numpy.concatenate([m[numpy.isfinite(m)].ravel() for m in matrices])
    if not finite.size:
        return {}
    if logarithmic:
        return {"vmin": finite.min(), "vmax": finite.max()}
    largest = numpy.abs(finite).max()
    return {"vmin": -largest, "vmax": largest}
