"""Push: adds the values of ghosts to their owners', in a fixed order of neighbours."""

from __future__ import annotations

from warp._src.arrays.observers import Observers, Place
from warp._src.distributed import forward
from warp._src.distributed.buffers import Buffer
from warp._src.distributed.communicator import Message
from warp._src.distributed.exchanges import Work
from warp._src.distributed.parts import additions, copying
from warp._src.distributed.plans import record, run_or_record, without_tape


class Adder:
    """Parts of arrays that travel between neighbours and are added there.

    Args:
        exchange: of the same fields; gives the sides.
    """

    def __init__(self, exchange):
        self.comm, self.name = exchange.comm, exchange.name
        self.plan, self.sides = exchange.plan, exchange.sides
        device = self.comm.device
        self.buffers = [(Buffer(s.give, device), Buffer(s.take, device)) for s in self.sides]
        outward, home = [], []
        for side, (own, ghosts) in zip(self.sides, self.buffers, strict=True):
            own, ghosts = own.bytes, ghosts.bytes
            own = own if own.size else None
            ghosts = ghosts if ghosts.size else None
            outward.append(Message(side.peer, own, ghosts, side.give_tag, side.take_tag))
            home.append(Message(side.peer, ghosts, own, side.take_tag, side.give_tag))
        self.works = {"outward": Work(self.comm, self.name, outward)}
        self.works["home"] = Work(self.comm, self.name, home)
        self._steps: dict = {}

    def _prepared(self, way, gradients):
        """Functions that pack, and those that add what has come."""
        found = self._steps.get((way, gradients))
        if found is None:
            packing, adding = found = [], []
            for side, (own, ghosts) in zip(self.sides, self.buffers, strict=True):
                ends = (side.take, ghosts), (side.give, own)
                sent, added = ends if way == "home" else reversed(ends)
                packing += _pairs(*sent, gradients)
                adding += _pairs(*added, gradients)
            packing = [copying(part, view) for view, part in packing]
            adding = [one for view, part in adding for one in additions(view, part)]
            found = self._steps[way, gradients] = packing, adding
        return found

    def add(self, way, gradients) -> None:
        """Adds owners' values to ghosts ("outward"), or ghosts' to owners ("home").

        Args:
            gradients: move gradients, and not values.
        """
        packing, adding = self._prepared(way, gradients)
        for function in packing:
            function()

        def transfer():
            self.plan[1] += 1
            self.comm.log.begin(*self.plan)
            self.works[way].start()
            self.works[way].finish()

        run_or_record(self.comm, self.name, transfer)
        for function in adding:
            function()


def _pairs(views, packed, gradients) -> list:
    """Parts of arrays, or of gradients, with the memory that they are packed in."""
    pairs = zip(views, packed.parts, strict=True)
    return [(view.grad if gradients else view, part) for view, part in pairs if view.size]


def push(blocks, fields) -> None:
    """Adds ghosts of fields to the cells that own them."""
    if Observers.executor is not None:
        forward.in_place(fields, lambda *fields: push(blocks, fields), together=True)
        return
    exchange = blocks._exchange("push", fields, None)
    if not hasattr(exchange, "adder"):
        exchange.adder = without_tape(lambda: Adder(exchange))
    adder = exchange.adder
    if Observers.active:
        for one in fields:
            Observers.memory.writing(one, Place("push"))
    without_tape(lambda: adder.add("home", False))
    tape = Observers.tape
    if tape is not None and any(one.requires_grad for one in fields):
        record(tape, lambda: adder.add("outward", True), list(fields))
