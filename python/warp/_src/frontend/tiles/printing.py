"""`print(t)` of a tile: one thread of the block shows all elements."""

from __future__ import annotations

import itertools
import math

from warp._src.frontend.bindings import INT32
from warp._src.frontend.tiles.arguments import TileTopic

# Elements that code to print is made for.
_MOST = 4096


class TilePrinting(TileTopic):
    """Translates the output of tiles."""

    def printed(self, tile, node):
        """Rows in brackets, then the shape; layouts are the compiler's, so all are registers."""
        shape, element = tile.type.shape, tile.type.element
        if element.kind == "struct" or math.prod(shape) > _MOST:
            raise self.context.type_error(
                node,
                f"print() expects a tile of at most {_MOST} numbers, vectors or matrices, but got "
                f"'{tile.type.python_name}'",
                "print a part of it",
            )
        threads = self.context.session.block_threads()
        self.context.at(node)
        zero, one = (self.builder.constant(INT32, number) for number in (0, 1))
        numbers = self.make("iota", [zero, one], node, shape=[threads], element=INT32)
        number = self.make("to_threads", [numbers], node, element=INT32)
        self.builder.begin_if(self.builder.builtin("eq", [number, zero])[0][0])
        output = self.context.output
        pieces = [
            (before + self.form(element, after), self.components(tile, place, node))
            for before, place, after in _elements(shape)
        ]
        text = ",".join(map(str, shape))
        output.print_pieces([*pieces, (f" = tile(shape=({text}), storage=register)\n", [])])
        self.builder.end_if([], [])

    def form(self, element, after):
        """The format of an element; those of several numbers are in parentheses."""
        one = self.context.output.scalar_format(element.element or element)
        count = math.prod(element.shape) if element.shape else 1
        count = {"quat": 4, "transform": 7}.get(element.kind, count)
        return (one if count == 1 else f"({' '.join([one] * count)})") + after

    def components(self, tile, place, node):
        indices = [self.builder.constant(INT32, one) for one in place]
        return self.context.output.parts(self.make("get", [tile, *indices], node), node)


def _elements(shape):
    """Indices in order, with the brackets, spaces and lines before and behind each."""
    rank, rows = len(shape), []
    for place in itertools.product(*map(range, shape)):
        opened = next((d for d in reversed(range(rank)) if place[d]), -1)
        closed = next((d for d in reversed(range(rank)) if place[d] != shape[d] - 1), -1)
        between = " " * (opened == rank - 1)
        if -1 < opened < rank - 1:
            between = ("\n" if opened == rank - 2 else "\n\n") + " " * (opened + 1)
        before = between + "[" * (rank - 1 - opened)
        rows.append((before, place, "]" * (rank - 1 - closed)))
    return rows
