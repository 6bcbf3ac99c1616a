"""Pictures of fields - surfaces, contours, arrows and deformed meshes by matplotlib."""

from __future__ import annotations

import os
import warnings

import numpy as np


class Plot:
    """Collects fields frame by frame, and shows or saves them.

    Args:
        stage: accepted for programs that name a USD stage; nothing is written there.
        default_point_radius: likewise.
    """

    def __init__(self, stage=None, default_point_radius=0.01):
        self.default_point_radius = default_point_radius
        self._fields: dict = {}

    def begin_frame(self, time) -> None:
        """Begins a frame."""

    def end_frame(self) -> None:
        """Ends a frame."""

    def add_field(self, name: str, field) -> None:
        """Adds the values that a field has now."""
        if name not in self._fields:
            self._fields[name] = (field.space, [])
        self._fields[name][1].append(field.dof_values.numpy().copy())

    def plot(self, options=None, backend: str = "auto", save: str | None = None) -> None:
        """Draws the last frame of all fields.

        Args:
            options: for each name "contours", "arrows", "streamlines" or "displacement" with
                their settings, "cmap", "clim", "xlim", "ylim"; and "rows" of the picture.
            backend: "matplotlib"; others are the same.
            save: file of the picture, or a folder that gets a file per frame; shown by default.
        """
        try:
            import matplotlib.pyplot as plt
        except ModuleNotFoundError:
            warnings.warn("matplotlib is needed to draw fields", stacklevel=2)
            return
        options = options or {}
        colors = {a.get("color") for a in options.values() if isinstance(a, dict)}
        names = [n for n in self._fields if n not in colors or options.get(n)]
        if not names:
            return
        if save is not None and (os.path.isdir(save) or save.endswith(("/", os.sep))):
            os.makedirs(save, exist_ok=True)
            for frame in range(max(len(self._fields[n][1]) for n in names)):
                figure = self._draw(plt, names, options, frame)
                figure.savefig(os.path.join(save, f"frame_{frame:04d}.png"))
                plt.close(figure)
            return
        figure = self._draw(plt, names, options, -1)
        if save is None:
            plt.show()
        else:
            figure.savefig(save, dpi=120)
            plt.close(figure)

    def _draw(self, plt, names, options, frame):
        rows = options.get("rows", 1)
        columns = -(-len(names) // rows)
        figure = plt.figure(figsize=(5 * columns, 4 * rows))
        for index, name in enumerate(names):
            space, frames = self._fields[name]
            values = frames[frame % len(frames)]
            own = options.get(name, {})
            positions = space.node_positions().numpy()
            is_solid = positions.shape[1] == 3
            is_flat = {"contours", "arrows", "streamlines", "displacement"} & own.keys()
            projection = "3d" if is_solid or not is_flat else None
            axes = figure.add_subplot(rows, columns, index + 1, projection=projection)
            color = values
            if own.get("color") in self._fields:
                others = self._fields[own["color"]][1]
                color = others[frame % len(others)]
            drawn = _draw_field(axes, space, positions, values, magnitude(color), own)
            axes.set_title(name)
            if not projection:
                axes.set_aspect("equal")
            for limit in ("xlim", "ylim"):
                if limit in own:
                    axes.set(**{limit: own[limit]})
            figure.colorbar(drawn, ax=axes)
        figure.tight_layout()
        return figure


def magnitude(values):
    """Numbers as they are, vectors and matrices by their norm."""
    return values if values.ndim == 1 else np.linalg.norm(values.reshape(len(values), -1), axis=1)


def _triangles(space, x, y):
    from matplotlib.tri import Triangulation

    if hasattr(space, "node_triangulation"):
        return Triangulation(x, y, space.node_triangulation())
    return Triangulation(x, y)


def _draw_field(axes, space, positions, values, color, options):
    style = {"cmap": options.get("cmap") or "viridis"}
    low, high = options.get("clim") or (color.min(), color.max())
    if positions.shape[1] == 3:
        x = positions
        if values.ndim == 2 and "arrows" in options:
            axes.quiver(*x.T, *values.T, length=0.1, normalize=True, cmap=style["cmap"])
        elif values.ndim == 2 and "displacement" in options:
            x = positions + values
        return axes.scatter(*x.T, c=color, vmin=low, vmax=high, **style)
    x, y = positions.T
    style.update(vmin=low, vmax=high)
    if "contours" in options:
        levels = options["contours"].get("levels")
        return axes.tricontourf(_triangles(space, x, y), color, levels=levels, **style)
    if values.ndim == 2 and "displacement" in options:
        moved = _triangles(space, x + values[:, 0], y + values[:, 1])
        axes.triplot(moved, lw=0.2, color="gray")
        return axes.tripcolor(moved, color, **style)
    if values.ndim == 2 and "streamlines" in options:
        return _streamlines(axes, space, x, y, values, style)
    if values.ndim == 2 and "arrows" in options:
        style = {"cmap": style["cmap"]}
        return axes.quiver(x, y, values[:, 0], values[:, 1], color, **style)
    return axes.plot_trisurf(_triangles(space, x, y), color, **style)


def _streamlines(axes, space, x, y, values, style):
    from matplotlib.tri import LinearTriInterpolator

    triangles = _triangles(space, x, y)
    grid = np.meshgrid(np.linspace(x.min(), x.max(), 100), np.linspace(y.min(), y.max(), 100))
    u, v = (LinearTriInterpolator(triangles, values[:, k])(*grid) for k in (0, 1))
    return axes.streamplot(*grid, u, v, color=np.hypot(u, v), cmap=style["cmap"]).lines
