"""Pictures of the particle demonstration."""

from typing import Any, cast

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgb
from matplotlib.lines import Line2D

from particles_precision import DRAGS, PRECISIONS, SCHEMES, curves

NIGHT = "#070b18"
WATER = LinearSegmentedColormap.from_list(
    "water", ["#1b4dff", "#19b5ff", "#7df3e1", "#fff3c4", "#ff9a5c"]
)
COLOURS = dict(zip(SCHEMES, ("#d95f02", "#1f6fb4")))
STYLES = dict(zip(PRECISIONS, (("--", "o"), ("-", "s"))))


def fountain(x, v, path, title, resolution=(900, 480), view=((-7.0, 8.0), (0.0, 8.0))):
    """Side view: brightness is the number of droplets per pixel, hue their mean speed.

    Args:
        x, v: positions and velocities, shape (n, 3) [m, m/s].
        path: PNG file to write.
    """
    shown = (x[:, 1] > 0.0) & np.isfinite(x).all(axis=1)
    across, height = x[shown, 0], x[shown, 1]
    speed = np.linalg.norm(v[shown], axis=1)
    grid = {"bins": resolution, "range": view}
    count, _, _ = np.histogram2d(across, height, **grid)
    total, _, _ = np.histogram2d(across, height, weights=speed, **grid)

    mean = np.divide(total, count, out=np.zeros_like(total), where=count > 0)
    top = float(np.percentile(speed, 99)) if speed.size else 1.0
    scale = Normalize(0.0, top)
    # Compress the range: single droplets stay visible, the jets do not burn out.
    full = np.percentile(count[count > 0], 99) if count.any() else 1.0
    glow = np.clip(np.log1p(count) / np.log1p(full), 0.0, 1.0)[..., None] ** 0.8
    image = np.array(to_rgb(NIGHT)) * (1.0 - glow) + WATER(scale(mean))[..., :3] * glow

    figure, axes = plt.subplots(figsize=(11, 6.0), dpi=150, layout="constrained")
    axes.imshow(
        image.transpose(1, 0, 2),
        origin="lower",
        interpolation="bilinear",
        extent=(*view[0], *view[1]),
        aspect="equal",
    )
    axes.set(xlabel="x [m]", ylabel="height [m]", title=title)
    colourbar = figure.colorbar(
        plt.cm.ScalarMappable(norm=scale, cmap=WATER), ax=axes, pad=0.01, shrink=0.9
    )
    colourbar.set_label("mean speed [m/s]")
    figure.savefig(path)
    plt.close(figure)


def _guides(axes, sizes):
    """Thin lines of slope one and two."""
    span = np.array([min(sizes), max(sizes)])
    for order, level in ((1, 3e-5), (2, 3e-10)):
        axes.plot(span, level * (span / span[0]) ** order, color="#999999", linewidth=0.8, zorder=0)
        axes.annotate(
            f"order {order}",
            (span[0], level),
            xytext=(14, -6),
            textcoords="offset points",
            color="#777777",
            fontsize=8,
        )


def _row(axes, groups):
    """One drag: error over step size on the left, over run time on the right."""
    ceiling = 3.0
    for index, ((_, scheme, precision), group) in enumerate(groups.items()):
        line, marker = STYLES[precision]
        look: dict[str, Any] = {"color": COLOURS[scheme], "linestyle": line, "marker": marker}
        look |= {"markersize": 5, "linewidth": 1.6, "markerfacecolor": "white"}
        cross = {"color": COLOURS[scheme], "marker": "x", "linestyle": "none"}
        good = [run for run in group if run.stable]
        bad = [run for run in group if not run.stable]
        # Crosses at one step size stand side by side.
        shift = 1.0 + 0.12 * (index - 1.5)
        for plot, abscissa, spread in (
            (axes[0], lambda run: run.step_size, shift),
            (axes[1], lambda run: 1e3 * run.seconds, 1.0),
        ):
            plot.loglog([abscissa(run) for run in good], [run.error for run in good], **look)
            plot.plot([abscissa(run) * spread for run in bad], [ceiling] * len(bad), **cross)


def work_precision(runs, path, title):
    """Error over step size and error over run time, a row for each drag; ✗ is unstable."""
    groups = curves(runs)
    figure, grid = plt.subplots(
        len(DRAGS), 2, figsize=(11, 8.5), dpi=150, layout="constrained", sharey=True
    )
    for row, drag in zip(grid, DRAGS):
        _row(row, {name: group for name, group in groups.items() if name[0] == drag})
        row[0].set(ylabel=f"{drag}\nrelative error of the positions", xlabel="step size dt [s]")
        row[1].set(xlabel="run time [ms]")
        for axes in row:
            axes.grid(True, which="major", color="#dddddd", linewidth=0.6)
            axes.axhline(1.0, color="#bbbbbb", linewidth=0.8, linestyle=":")
            axes.spines[["top", "right"]].set_visible(False)
    _guides(grid[0, 0], [run.step_size for run in runs])
    grid[0, 0].set_title("error over step size")
    grid[0, 1].set_title("work-precision")
    handles = [
        Line2D(
            [],
            [],
            color=COLOURS[scheme],
            linestyle=cast(Any, line),
            marker=marker,
            markerfacecolor="white",
            label=f"{scheme}, {precision}",
        )
        for scheme in SCHEMES
        for precision, (line, marker) in STYLES.items()
    ]
    handles.append(Line2D([], [], color="#555555", marker="x", linestyle="none", label="unstable"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    figure.suptitle(title)
    figure.savefig(path)
    plt.close(figure)
