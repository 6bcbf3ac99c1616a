"""The control flow of a block's code as Python (`block_emulator` has its operations)."""

import random
import re

import numpy as np
from support.block_emulator import (
    Memory,
    element_type,
    name_of,
    rebits,
    statement,
    unsigned,
    wrap,
)


class _Translation:
    def __init__(self, lines):
        self.lines, self.out, self.depth, self.open = lines, [], 1, []

    def emit(self, text):
        self.out.append("    " * self.depth + text)

    def results(self, text, count):
        name = name_of(text.partition(":")[0])
        return [name] if count == 1 else [f"{name}_{i}" for i in range(count)]

    def run(self):
        for line in self.lines:
            if line == "return":
                continue
            if line == "} else {":
                self.depth -= 1
                self.emit("else:")
                self.depth += 1
                self.emit("pass")
            elif line == "}" or line.startswith("} {"):
                self.close()
            elif "scf.for" in line:
                self.begin_for(line)
            elif "scf.if" in line:
                head, _, rest = line.rpartition("scf.if ")
                types = re.search(r"-> \(([^)]*)\)", rest)
                count = types[1].count(",") + 1 if types else 0
                self.emit(f"if {name_of(rest.split()[0])}:")
                self.begin(self.results(head[:-3], count) if count else [], None)
            elif line.startswith("scf.yield"):
                values = re.sub(r" : .*", "", line[len("scf.yield ") :]).split(",")
                names = self.open[-1][0]
                self.emit(f"{', '.join(names)} = {', '.join(map(name_of, values))}")
            else:
                self.emit(statement(line))
        return self.out

    def begin(self, names, step):
        self.open.append((names, step))
        self.depth += 1
        self.emit("pass")

    def begin_for(self, line):
        head, _, rest = line.rpartition("scf.for ")
        index, first, end, step = re.match(
            r"(%\w+) = (%[\w-]+) to (%[\w-]+) step (%[\w-]+)", rest
        ).groups()
        carried = re.findall(r"(%\w+) = (%[\w#-]+)", rest[rest.find("iter_args") :])
        names = [name_of(name) for name, _ in carried] if "iter_args" in rest else []
        for name, (_, value) in zip(names, carried, strict=False):
            self.emit(f"{name} = {name_of(value)}")
        self.emit(
            f"for {name_of(index)} in range({name_of(first)}, {name_of(end)}, {name_of(step)}):"
        )
        self.begin(names, self.results(head[:-3], len(names)) if names else None)

    def close(self):
        if not self.open:
            return
        names, results = self.open.pop()
        self.depth -= 1
        for result, name in zip(results or (), names, strict=False):
            self.emit(f"{result} = {name}")


def run_block(kernel, arrays, seed=0, waits=True):
    """Runs one block of a kernel's code for a GPU on NumPy arrays, which it changes.

    Args:
        kernel: one of tiles, that reads no index of a thread.
        arrays: its arguments in order.
        seed: chooses the order of threads.
        waits: without, no thread waits for another one, which shows what barriers are for.
    """
    program, threads, room = _program(kernel.ir("thread", arch=90), waits)
    _run(program, threads, room, arrays, random.Random(seed), None, ())


def run_launch(kernel, arrays, dim, threads, seed=0):
    """Runs what a GPU runs for a launch over an extent or a tuple of them, block after block.

    Args:
        kernel, arrays, seed: as for `run_block`; it may read indices.
        threads: of a block.
    """
    dim = dim if isinstance(dim, tuple) else (dim,)
    native = kernel.prepare()
    native, _ = kernel.place(native, dim, 0, threads, arrays)
    program, count, room = _program(native.ir("thread", 90, len(dim)), True)
    total = int(np.prod(dim))
    for block in range(-(-total // threads)):

        def tid(thread, first=block * threads):
            # A thread beyond the launch has the index of the last one.
            return map(int, np.unravel_index(min(first + thread, total - 1), dim))

        _run(program, count, room, arrays, random.Random(seed), tid, dim)


def _program(text, waits):
    """Code of a thread, the threads of a block, and bytes of its memory."""
    lines = [line.strip() for line in text.splitlines()]
    head = next(i for i, line in enumerate(lines) if line.startswith("func.func"))
    threads, room = (
        int(re.search(rf"{name} = (\d+)", lines[head])[1])
        for name in ("block_threads", "block_bytes")
    )
    body = [line for line in lines[head + 1 :] if line and (waits or line != "warp.barrier")]
    head = "def program(thread, block, v_arg, tid, dim):"
    text = "\n".join([head, *_Translation(body).run(), "    yield"])
    text = re.sub(r"v_arg(\d+)\.", r"v_arg[\1].", text)
    space = {"np": np, "wrap": wrap, "unsigned": unsigned, "rebits": rebits}
    exec(text, space)
    return space["program"], threads, room


def _run(program, threads, room, arrays, order, tid, dim):
    # An unwritten element is not zero.
    memory = np.full(room + 8, 0xA5, dtype=np.uint8)

    def block(place, count, type):
        dtype, parts = element_type(type)
        data = memory[place : place + count * parts * dtype.itemsize].view(dtype)
        return Memory(data.reshape(count, parts) if parts > 1 else data)

    given = [Memory(array) for array in arrays]
    waiting = [program(thread, block, given, tid, dim) for thread in range(threads)]
    while waiting:
        order.shuffle(waiting)
        done = [next(one, "end") for one in waiting]
        # All threads wait equally often.
        assert len({step is None for step in done}) == 1, "threads part at a barrier"
        if done[0] is not None:
            break
