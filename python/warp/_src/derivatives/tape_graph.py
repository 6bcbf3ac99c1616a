"""A tape as a GraphViz drawing: boxes are records, ellipses are arrays, frames are scopes."""

from __future__ import annotations

import html

from warp._src.derivatives.tape_records import LaunchRecord
from warp._src.types import dtypes

_HEADER = """digraph tape {{
    rankdir={direction};
    node [fontname="Helvetica", fontsize=11, margin="0.08,0.04"];
    edge [fontname="Helvetica", color="#555555"];
"""
_GRADIENT, _CONSTANT = "#cfe8b0", "#e0e0e0"


def draw(tape, labels, *, simplify, hide_readonly, longest, scopes, tracked, direction) -> str:
    """The text of the drawing. `labels` are names of arrays."""
    drawing = _Drawing(tape, labels, simplify, longest)
    lines = [_HEADER.format(direction=direction)]
    lines += drawing.boxes(scopes)
    lines += drawing.arrays(hide_readonly, {_key(one) for one in tracked})
    lines += drawing.arrows(hide_readonly)
    lines.append("}\n")
    return "\n".join(lines)


class _Drawing:
    def __init__(self, tape, labels, simplify, longest):
        self.tape = tape
        self.names = {_key(one): name for one, name in labels.items()}
        self.fixed = set(self.names)
        self.longest = longest
        self.found: dict = {}
        self.written: set = set()
        # Box of each record; several launches of a kernel in a row share one.
        self.box: list[int] = []
        self.edges: dict = {}
        for position, record in enumerate(tape.launches):
            self._visit(position, record, simplify)

    def _visit(self, position, record, simplify) -> None:
        starts_scope = any(place == position for place, _, _ in self.tape.scopes)
        previous = self.tape.launches[position - 1] if position else None
        repeated = (
            simplify
            and not starts_scope
            and isinstance(record, LaunchRecord)
            and isinstance(previous, LaunchRecord)
            and previous.kernel is record.kernel
        )
        box = self.box[-1] if repeated else position
        self.box.append(box)
        if isinstance(record, LaunchRecord):
            named = [(name, one) for name, one in record.call.leaves if one is not None]
        else:
            named = [("", one) for one in record.arrays()]
        written = {_key(one) for one in record.written()}
        self.written |= written
        for name, one in named:
            key = _key(one)
            self.found.setdefault(key, one)
            self._name(key, name)
            if key in written:
                self.edges[f"r{box}", key, True] = name
            if key not in written or (isinstance(record, LaunchRecord) and _reads(record, one)):
                self.edges[f"r{box}", key, False] = name

    def _name(self, key, name) -> None:
        known = self.names.get(key, "")
        if key not in self.fixed and (not known or (self.longest and len(name) > len(known))):
            self.names[key] = name

    def boxes(self, scopes) -> list[str]:
        """Nodes of the records, in frames for their scopes."""
        events = list(self.tape.scopes) if scopes else []
        lines, depth = [], 0
        for position in range(len(self.box) + 1):
            while events and events[0][0] <= position:
                _, name, metadata = events.pop(0)
                if name is None:
                    depth -= 1
                    lines.append("    }")
                else:
                    depth += 1
                    tip = ", ".join(f"{key}={value}" for key, value in metadata.items())
                    lines.append(
                        f"    subgraph cluster_{position}_{depth} {{ label={_quoted(name)}; "
                        f'tooltip={_quoted(tip)}; style="rounded,filled"; fillcolor="#f4f4f4";'
                    )
            if position < len(self.box) and self.box[position] == position:
                lines.append(self._node(position))
        return lines + ["    }"] * depth

    def _node(self, position) -> str:
        event = self.tape.launches[position].event
        count = self.box.count(position)
        record = self.tape.launches[position]
        title = record.kernel.key if isinstance(record, LaunchRecord) else event.what
        if count > 1:
            title += f", repeated {count}x"
        tip = f"{event.file}:{event.line}"
        return (
            f"    r{position} [shape=box, style=filled, fillcolor=white, "
            f"label={_quoted(title)}, tooltip={_quoted(tip)}];"
        )

    def arrays(self, hide_readonly, tracked) -> list[str]:
        """Nodes of the arrays."""
        lines = []
        for key, one in self.found.items():
            if hide_readonly and key not in self.written:
                continue
            color = _GRADIENT if one.requires_grad else _CONSTANT
            width = ", penwidth=3" if key in tracked else ""
            about = f"array: dtype={dtypes.type_repr(one.dtype)} shape={one.shape} on {one.device}"
            lines.append(
                f"    {_node_of(key)} [shape=ellipse, style=filled, "
                f'fillcolor="{color}"{width}, label={_quoted(self.names[key] or "array")}, '
                f"tooltip={_quoted(about)}];"
            )
        return lines

    def arrows(self, hide_readonly) -> list[str]:
        """From arrays that are read to records, from records to arrays that are written."""
        lines = []
        for (box, key, out), name in self.edges.items():
            if hide_readonly and key not in self.written:
                continue
            ends = (box, _node_of(key)) if out else (_node_of(key), box)
            lines.append(f"    {ends[0]} -> {ends[1]} [tooltip={_quoted(name)}];")
        return lines


def _key(one) -> tuple:
    return (one.ptr, one.shape, one.strides)


def _node_of(key) -> str:
    return "a" + "_".join(str(part) for part in (key[0] or 0, *key[1], *key[2]))


def _quoted(text) -> str:
    return '"' + html.escape(str(text), quote=True).replace("\n", " ") + '"'


def _reads(record, one) -> bool:
    """True if a launch may read an array."""
    return any(
        leaf is one and (access[0] or access[2])
        for (_, leaf), access in zip(record.call.leaves, record.call.accesses, strict=True)
    )
