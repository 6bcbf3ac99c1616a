"""Figures as SVG that read well on light and on dark ground.

Text and axes are drawn in one marked colour that becomes `currentColor`; the file carries a style
that follows the reader's colour scheme. Curves use hues that keep their contrast on both. Points of
curves carry their values as titles, which browsers show under the pointer.
"""

import html
import io
import math
import re

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import MaxNLocator, NullLocator, StrMethodFormatter

from warp.report._analysis import curves_of, error_names, label_of, scene_parameters

#: Replaced by `currentColor`.
INK = "#010203"
#: Contrast of at least 3 : 1 on white and on #151515.
HUES = ("#3f7fd9", "#d9622b", "#2a9d6f", "#b454c4", "#b5830f", "#d1476b", "#1f97ad", "#7a7a7a")
MARKERS = "osD^vP*X"
#: Curves beyond the hues are told apart by their lines.
LINES = ("-", (0, (5, 2)), (0, (1, 1.5)), (0, (6, 2, 1, 2)))
VERDICTS = {"ok": "#2a9d6f", "diverged": "#d9622b", "nonfinite": "#d1476b"}
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "warp.report",
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#8a8a8a",
    "grid.alpha": 0.3,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "font.size": 9,
    "axes.titlesize": 10,
}


def _thin_ticks(axes):
    """No ticks between powers of ten where there are several, and plain numbers at the others.

    Formulas as labels take most of the time of a page, and overlap where a range is short.
    """
    for axis in (axes.xaxis, axes.yaxis):
        low, high = sorted(axis.get_view_interval())
        if axis.get_scale() not in ("log", "symlog"):
            continue
        axis.set_minor_locator(NullLocator())
        if axis.get_scale() == "log" and 0.0 < high <= 30.0 * low:
            axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter(StrMethodFormatter("{x:.4g}"))


def _hover(figure):
    """Circles with titles over the points of curves, in the coordinates of the SVG."""
    parts, scale = [], 72.0 / figure.dpi
    height = figure.get_figheight() * 72.0
    for axes in figure.axes:
        for line in axes.lines:
            for (x, y), at in zip(
                line.get_xydata(), line.get_transform().transform(line.get_xydata())
            ):
                if not line.get_label() or line.get_label().startswith("_"):
                    continue
                if not (np.isfinite(at).all() and line.get_marker() not in (None, "None", "")):
                    continue
                text = (
                    f"{line.get_label()}\n{axes.get_xlabel()} {x:.4g}\n{axes.get_ylabel()} {y:.4g}"
                )
                parts.append(
                    f'<circle cx="{at[0] * scale:.1f}" cy="{height - at[1] * scale:.1f}" r="6" '
                    f'fill="none" pointer-events="all"><title>{html.escape(text)}</title></circle>'
                )
    return "".join(parts)


def _svg(figure):
    for axes in figure.axes:
        _thin_ticks(axes)
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None})
    hover = _hover(figure)
    plt.close(figure)
    text = buffer.getvalue().replace(INK, "currentColor")
    style = "<style>svg{color:#222}@media (prefers-color-scheme: dark){svg{color:#ddd}}</style>"
    text = re.sub(r"(<svg[^>]*>)", rf"\1{style}", text[text.index("<svg") :], count=1)
    end = text.rindex("</svg>")
    return text[:end] + hover + text[end:]


def _finite(records, name):
    return [r for r in records if r["status"] == "ok" and r["errors"].get(name, 0.0) > 0.0]


def _exact(records, name):
    """Points without an error, which a logarithmic axis has no place for."""
    return [r for r in records if r["status"] == "ok" and r["errors"].get(name) == 0.0]


def _look(index):
    return {
        "color": HUES[index % len(HUES)],
        "marker": MARKERS[index % len(MARKERS)],
        "linestyle": LINES[index // len(HUES) % len(LINES)],
        "markersize": 5,
        "linewidth": 1.5,
    }


def _draw_curves(axes, curves, fixed, name, abscissa):
    """Curves of one error; failed points as crosses at the upper edge, exact ones at the lower."""
    edges = []
    for index, (key, curve) in enumerate(curves.items()):
        good = _finite(curve, name)
        x = [abscissa(record) for record in good]
        y = [record["errors"][name] for record in good]
        axes.plot(x, y, label=label_of(key, fixed), **_look(index))
        colour = HUES[index % len(HUES)]
        failed = [record for record in curve if record["status"] != "ok"]
        for marker, place, records in (("x", 1, failed), (11, 0, _exact(curve, name))):
            at = [abscissa(record) for record in records]
            edges += [(one, place, marker, colour) for one in at if one is not None]
    axes.set(xscale="log", yscale="log", ylabel=f"error of {name}")
    _mark_edges(axes, edges)


def _mark_edges(axes, edges):
    """Points that have no place between the edges; they do not widen the axes."""
    limits = axes.get_ylim()
    for x, place, marker, colour in edges:
        axes.plot(
            [x], [limits[place]], marker=marker, color=colour, clip_on=False, linestyle="none"
        )
    axes.set_ylim(limits)


def _guides(axes, orders=(1, 2, 4)):
    """Thin lines of given slopes through the lower left of the data."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    for order in orders:
        span = np.array([x0, x1])
        line = y0 * (span / x0) ** order
        axes.plot(span, line, color="#8a8a8a", linewidth=0.7, linestyle=":", zorder=0)
        end = min(x1, x0 * (y1 / y0) ** (1.0 / order))
        axes.annotate(
            f"{order}", (end, y0 * (end / x0) ** order), fontsize=7, color="#8a8a8a", ha="right"
        )
    axes.set(xlim=(x0, x1), ylim=(y0, y1))


def _panels(count):
    columns = 2 if count == 4 else min(3, count)
    rows = math.ceil(count / columns)
    figure, grid = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 3.1 * rows), squeeze=False, layout="constrained"
    )
    for axes in grid.flat[count:]:
        axes.set_visible(False)
    return figure, grid.flat


def _legend(figure, axes):
    """Below the panels, in as many columns as its longest label leaves room for."""
    handles, labels = axes.get_legend_handles_labels()
    if not labels:
        return
    # Inches of a label: its letters, and its line.
    width = 0.075 * max(map(len, labels)) + 0.6
    columns = max(1, min(4, len(labels), int(figure.get_figwidth() / width)))
    figure.set_figheight(figure.get_figheight() + 0.2 * math.ceil(len(labels) / columns))
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def errors(scene, records, fixed):
    """Small multiples: for each error, against the swept parameter and against run time."""
    axis, names = scene.sweep.name, error_names(records)
    names = [name for name in names if _finite(records, name)]
    if not names:
        return None
    curves = curves_of(records, axis)
    with plt.rc_context(STYLE):
        figure, panels = _panels(2 * len(names))
        for name in names:
            left, right = next(panels), next(panels)
            _draw_curves(left, curves, fixed, name, lambda record: record["parameters"][axis])
            left.set(title=f"{name}: error over {axis}", xlabel=axis)
            _guides(left)
            _draw_curves(
                right,
                curves,
                fixed,
                name,
                lambda record: 1e3 * record["seconds"]["median"] if "seconds" in record else None,
            )
            right.set(title=f"{name}: work-precision", xlabel="run time [ms]")
        _legend(figure, left)
        return _svg(figure)


def drift(scene, records, fixed):
    """Errors over time of the finest point of each curve, with a straight line through each."""
    curves = curves_of(records, scene.sweep.name)
    names = sorted({name for record in records for name in record["series"]})
    if not names:
        return None
    with plt.rc_context(STYLE):
        figure, panels = _panels(len(names))
        for name, axes in zip(names, panels):
            for index, (key, curve) in enumerate(curves.items()):
                good = [r for r in curve if r["status"] == "ok" and name in r["series"]]
                if not good:
                    continue
                time, error = map(np.asarray, good[-1]["series"][name])
                look = _look(index) | {"marker": None, "linewidth": 1.0}
                axes.plot(time, error, label=label_of(key, fixed), **look)
                if len(time) > 2:
                    slope, start = np.polyfit(time, error, 1)
                    axes.plot(time, start + slope * time, color=look["color"], linestyle=":")
            axes.set(title=f"{name} over time", xlabel="time [s]", ylabel=name, yscale="symlog")
            limit = max((abs(v) for line in axes.lines for v in line.get_ydata()), default=1.0)
            axes.set_yscale("symlog", linthresh=max(limit * 1e-3, 1e-16))
        _legend(figure, axes)
        return _svg(figure)


def stability_map(scene, records):
    """Status over two swept numbers; None where a scene has not two."""
    numeric = [
        sweep.name
        for sweep in (*scene.curves, scene.sweep)
        if all(isinstance(value, (int, float)) for value in sweep.values) and len(sweep.values) > 2
    ]
    if len(numeric) < 2:
        return None
    down, across = numeric[0], numeric[-1]
    groups = {}
    for record in records:
        rest = {k: v for k, v in record["parameters"].items() if k not in (down, across)}
        groups.setdefault((record["device"], record["dtype"], tuple(rest.items())), []).append(
            record
        )
    with plt.rc_context(STYLE | {"axes.grid": False}):
        figure, panels = _panels(len(groups))
        for (key, group), axes in zip(groups.items(), panels):
            for record in group:
                x, y = record["parameters"][across], record["parameters"][down]
                colour = VERDICTS.get(record["status"], "#7a7a7a")
                axes.scatter([x], [y], marker="s", s=90, color=colour, linewidth=0)
                if record["verdict"] == "red":
                    axes.scatter([x], [y], marker="x", s=40, color=INK)
            axes.set(xscale="log", yscale="log", xlabel=across, ylabel=down)
            axes.set_title(label_of(key))
        handles = [
            plt.Line2D([], [], marker="s", linestyle="none", color=colour, label=status)
            for status, colour in VERDICTS.items()
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=3)
        return _svg(figure)


def gradients(scene, records, fixed):
    """Norm of the gradient over the sweep (the horizon), one curve each."""
    if not any("gradient_norm" in record for record in records):
        return None
    axis = scene.sweep.name
    with plt.rc_context(STYLE):
        figure, panels = _panels(1)
        axes = next(panels)
        for index, (key, curve) in enumerate(curves_of(records, axis).items()):
            good = [r for r in curve if r.get("gradient_norm", 0.0) > 0.0]
            x = [record["parameters"][axis] for record in good]
            y = [record["gradient_norm"] for record in good]
            axes.plot(x, y, label=label_of(key, fixed), **_look(index))
        title = f"norm of the gradient over {axis}"
        axes.set(title=title, xlabel=axis, ylabel="norm of the gradient", yscale="log")
        _legend(figure, axes)
        return _svg(figure)


#: Where the time of a point goes, in this order.
TIMES = ("setup", "first", "median", "read", "gradient")
TIME_LABELS = ("set-up, copies in", "compiled or loaded", "run", "copies out", "gradient")


def times(scene, records, fixed):
    """Stacked bars: where the time of the finest point of each curve goes."""
    curves = curves_of(records, scene.sweep.name)
    rows = [(label_of(key, fixed), curve[-1]) for key, curve in curves.items()]
    rows = [(label, record) for label, record in rows if "seconds" in record]
    if not rows:
        return None
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8.4, 1.2 + 0.32 * len(rows)), layout="constrained")
        left = np.zeros(len(rows))
        for index, (name, label) in enumerate(zip(TIMES, TIME_LABELS)):
            width = np.array([1e3 * record["seconds"].get(name, 0.0) for _, record in rows])
            if width.any():
                axes.barh(range(len(rows)), width, left=left, label=label, color=HUES[index])
            left += width
        axes.set_yticks(range(len(rows)), [label for label, _ in rows])
        axes.invert_yaxis()
        axes.set(xlabel="time [ms]", title="where the time goes, at the finest point")
        _legend(figure, axes)
        return _svg(figure)


def all_figures(scene, records):
    """`{name: SVG text}` of what a scene's records have to show."""
    fixed = set(scene.fixed) | {
        name
        for name in scene_parameters(records)
        if len({str(record["parameters"].get(name)) for record in records}) == 1
    }
    fixed.discard(scene.sweep.name)
    made = {
        "errors": errors(scene, records, fixed),
        "drift": drift(scene, records, fixed),
        "stability": stability_map(scene, records),
        "gradients": gradients(scene, records, fixed),
        "times": times(scene, records, fixed),
    }
    return {name: text for name, text in made.items() if text}
