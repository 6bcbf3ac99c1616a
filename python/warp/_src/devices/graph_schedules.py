"""Schedules of graphs: dependency DAG, branches, what prevents parallelism; text and pictures."""

from __future__ import annotations

import dataclasses
import html
import pathlib


@dataclasses.dataclass(frozen=True)
class GraphNode:
    """An operation of a graph.

    Attributes:
        name: of the kernel, or what the operation is.
        branch: number of the chain of operations that it belongs to.
        threads: of a launch, 0 for other operations.
        bytes: that it may read and write.
        before: numbers of the operations that it comes behind, each with the reason.
        barrier: why it keeps its order with all others, or empty.
        body: schedule of the body of a branch or loop, or None.
        parts: the launches that are one here; empty for a single one.
        apart: why a launch is not fused with one of equal extents that it comes behind, or empty.
    """

    name: str
    branch: int
    threads: int
    bytes: int
    before: dict[int, str]
    barrier: str
    body: GraphSchedule | None
    parts: tuple[str, ...]
    apart: str

    def __str__(self):
        return f"{self.name} ({self.threads:,} threads)" if self.threads else self.name


@dataclasses.dataclass(frozen=True)
class GraphSchedule:
    """The order of a graph's operations, from `Graph.schedule`.

    Attributes:
        nodes: the operations, each behind those that it comes behind.
        branches: how many chains of operations there are.
        recorded_edges: edges between operations as they were recorded.
        edges: edges that are left.
        kept: why the graph runs in the order of its recording, or empty.
    """

    nodes: tuple[GraphNode, ...]
    branches: int
    recorded_edges: int
    edges: int
    kept: str

    @classmethod
    def of(cls, found) -> GraphSchedule:
        """The schedule that the runtime describes."""
        nodes = tuple(
            GraphNode(**{**node, "body": None if node["body"] is None else cls.of(node["body"])})
            for node in found["nodes"]
        )
        return cls(**{**found, "nodes": nodes})

    @property
    def depth(self) -> int:
        """Operations of the longest path."""
        return max(self._levels(), default=-1) + 1

    @property
    def fusions(self) -> tuple[tuple[str, ...], ...]:
        """The launches of each fused one."""
        return tuple(node.parts for node in self.nodes if node.parts)

    @property
    def fused(self) -> int:
        """Launches that are parts of fused ones."""
        return sum(map(len, self.fusions))

    def _levels(self):
        levels = []
        for node in self.nodes:
            levels.append(1 + max((levels[number] for number in node.before), default=-1))
        return levels

    def __str__(self):
        return "\n".join(self._lines())

    def _lines(self, indent=""):
        if self.kept:
            return [f"{indent}as recorded: {self.kept}"]
        lines = [
            f"{indent}{len(self.nodes)} operations on {self.branches} branches, longest path "
            f"{self.depth}; {self.edges} edges, recorded with {self.recorded_edges}"
        ]
        if self.fused:
            lines[0] += f"; {self.fused} launches in {len(self.fusions)} fused ones"
        for number, node in enumerate(self.nodes):
            line = f"{indent}{number:4}  branch {node.branch}  {node}"
            if node.barrier:
                line += f"; with all others in order: {node.barrier}"
            reasons = [] if node.barrier else node.before.items()
            line += "".join(f"; after {other}: {reason}" for other, reason in reasons)
            if node.apart:
                line += f"; not fused: {node.apart}"
            lines.append(line)
            if node.body is not None:
                lines += node.body._lines(indent + "      ")
        return lines

    def save_picture(self, path) -> None:
        """Draws the graph: an SVG, or Graphviz text if the name ends in `.dot`."""
        path = pathlib.Path(path)
        path.write_text(self._dot() if path.suffix == ".dot" else self._svg(), encoding="utf-8")

    def _dot(self):
        lines = ["digraph graph {", "  node [shape=box];"]
        self._add_dot(lines, "n")
        return "\n".join([*lines, "}\n"])

    def _add_dot(self, lines, prefix):
        for number, node in enumerate(self.nodes):
            label = str(node).replace('"', '\\"')
            lines.append(f'  {prefix}{number} [label="{label}"];')
            for other, reason in node.before.items():
                text = reason.replace('"', '\\"')
                lines.append(f'  {prefix}{other} -> {prefix}{number} [label="{text}"];')
            if node.body is not None and node.body.nodes:
                node.body._add_dot(lines, f"{prefix}{number}_")
                lines.append(f"  {prefix}{number} -> {prefix}{number}_0 [style=dashed];")

    def _svg(self):
        """Levels from top to bottom, branches from left to right; bodies are not drawn."""
        width, height, gap = 190, 26, 22
        levels, taken, places = self._levels(), {}, []
        for node, level in zip(self.nodes, levels):
            row = taken.setdefault(level, set())
            column = node.branch
            # Branches that have ended leave their column to others.
            column = next(free for free in range(column + 1) if free not in row)
            row.add(column)
            places.append((10 + column * (width + gap), 10 + level * (height + gap)))
        right = max((x for x, _ in places), default=0) + width + 10
        bottom = max((y for _, y in places), default=0) + height + 10
        parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{right}" height="{bottom}" '
            'font-family="sans-serif" font-size="11">'
        ]
        for node, (x, y) in zip(self.nodes, places):
            for other, reason in node.before.items():
                from_x, from_y = places[other]
                parts.append(
                    f'<path d="M{from_x + width / 2} {from_y + height} C{from_x + width / 2} '
                    f"{from_y + height + gap} {x + width / 2} {y - gap} {x + width / 2} "
                    f'{y}" fill="none" stroke="#888"><title>{html.escape(reason)}</title></path>'
                )
        for node, (x, y) in zip(self.nodes, places):
            fill = "#f4d9c6" if node.barrier else "#dfe8f5"
            parts.append(
                f'<g><title>{html.escape(node.barrier or str(node))}</title><rect x="{x}" y="{y}" '
                f'width="{width}" height="{height}" rx="4" fill="{fill}" stroke="#555"/>'
                f'<text x="{x + 6}" y="{y + 17}">{html.escape(node.name[:30])}</text></g>'
            )
        return "\n".join([*parts, "</svg>\n"])
