"""Pictures of Jacobians with Matplotlib, which is imported when one is asked for."""

from __future__ import annotations

import numpy

from warp._src.array import array


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
        inputs: accepted for compatibility; not needed.
        show_plot: open a window.
        show_colorbar: draw the scale of colours.
        scale_colors_per_submatrix: let each picture have a scale of its own.
        title: headline, by default the function's name.
        colormap: Matplotlib's name of the colours.
        log_scale: colours by the logarithm of the absolute value.

    Returns:
        The Matplotlib figure.
    """
    names = _names(kernel)
    matrices = {(target, source): _matrix(values) for (source, target), values in jacobians.items()}
    return show_matrices(
        matrices,
        title or getattr(kernel, "key", getattr(kernel, "__name__", "")),
        show=show_plot,
        colorbar=show_colorbar,
        separate=scale_colors_per_submatrix,
        colormap=colormap,
        logarithmic=log_scale,
        names=names,
    )


def _matrix(values) -> numpy.ndarray:
    numbers = values.numpy()
    return numbers.reshape(numbers.shape[0], -1)


def _names(kernel) -> dict:
    """Labels of inputs by position, as far as they are known."""
    if hasattr(kernel, "input_labels"):
        labels = kernel.input_labels
        return dict(labels) if isinstance(labels, dict) else dict(enumerate(labels))
    code = getattr(getattr(kernel, "func", kernel), "__code__", None)
    return dict(enumerate(code.co_varnames[: code.co_argcount])) if code else {}


def show_matrices(
    matrices: dict,
    title: str = "",
    show: bool = True,
    colorbar: bool = True,
    separate: bool = False,
    colormap: str = "coolwarm",
    logarithmic: bool = False,
    names: dict | None = None,
):
    """Draws matrices, keyed by (row, column) or by a headline, as coloured squares."""
    import matplotlib.pyplot as plt

    grid = {key if isinstance(key, tuple) else (0, key): m for key, m in matrices.items()}
    rows = sorted({key[0] for key in grid}, key=str)
    columns = sorted({key[1] for key in grid}, key=str)
    figure, axes = plt.subplots(len(rows), len(columns), squeeze=False, layout="constrained")
    if logarithmic:
        grid = {key: numpy.log10(numpy.abs(m) + 1e-30) for key, m in grid.items()}
    finite = [m[numpy.isfinite(m)] for m in grid.values()]
    largest = max((numpy.abs(m).max() for m in finite if m.size), default=1.0)
    for i, row in enumerate(rows):
        for j, column in enumerate(columns):
            picture = axes[i][j]
            if (row, column) not in grid:
                picture.axis("off")
                continue
            limits = {} if separate or logarithmic else {"vmin": -largest, "vmax": largest}
            image = picture.imshow(grid[row, column], cmap=colormap, aspect="auto", **limits)
            picture.set_xlabel((names or {}).get(column, str(column)))
            picture.set_ylabel(f"output {row}")
            if colorbar and (separate or j == len(columns) - 1):
                figure.colorbar(image, ax=picture)
    figure.suptitle(title)
    if show:
        plt.show()
    return figure
