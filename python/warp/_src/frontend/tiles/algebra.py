"""Matrix products of tiles."""

from __future__ import annotations

from warp._src.frontend.bindings import FLOAT32
from warp._src.frontend.parameters import known
from warp._src.frontend.tiles.arguments import TileTopic


class TileAlgebra(TileTopic):
    """Translates what takes tiles for matrices."""

    def product(self, node, a, b, alpha, out=None, beta=None):
        """`alpha a b + beta out`; without `out`, elements are of the wider type of both."""
        shape = [a.type.shape[0], b.type.shape[1]]
        if out is not None:
            element = out.type.element
        else:
            element = max(a.type.element, b.type.element, key=lambda native: native.width)
        native = FLOAT32 if element.width == 16 else element
        # Times zero, even what is no number does not count.
        keeps = out is not None and known(beta) != 0
        operands = [a, b]
        if keeps or known(alpha) != 1:
            operands.append(self.convert(alpha, native, node, "tile_matmul"))
        if keeps:
            operands += [out, self.convert(beta, native, node, "tile_matmul")]
        return self.make("matmul", operands, node, shape=shape, element=element)
