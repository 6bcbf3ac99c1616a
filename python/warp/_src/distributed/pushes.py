"""Push: adds the values of ghosts to their owners', in a fixed order of neighbours."""

from __future__ import annotations

from warp._src.arrays.observers import Observers, Place
from warp._src.derivatives import cotangents
from warp._src.distributed import forward
from warp._src.distributed.communicator import Message
from warp._src.distributed.plans import Buffer, Work, _copy, record, run_or_record, without_tape


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

    def add(self, way, gradients) -> None:
        """Adds owners' values to ghosts ("outward"), or ghosts' to owners ("home").

        Args:
            gradients: move gradients, and not values.
        """
        home = way == "home"
        pairs = list(zip(self.sides, self.buffers, strict=True))
        for side, (own, ghosts) in pairs:
            views, packed = (side.take, ghosts) if home else (side.give, own)
            for view, part in zip(views, packed.parts, strict=True):
                _copy(part, view.grad if gradients else view)

        def transfer():
            self.plan[1] += 1
            self.comm.log.begin(*self.plan)
            self.works[way].start()
            self.works[way].finish()

        run_or_record(self.comm, self.name, transfer)
        for side, (own, ghosts) in pairs:
            views, packed = (side.give, own) if home else (side.take, ghosts)
            for view, part in zip(views, packed.parts, strict=True):
                if view.size:
                    cotangents.add_into(view.grad if gradients else view, part)


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
