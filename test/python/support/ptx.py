"""An interpreter of PTX: runs the threads of a grid on the host, warp by warp.

It is for code of warps, which no machine without a GPU runs; block_emulator.py runs the IR of tiles
in any order of threads. Warps run in lockstep: of the threads that have not ended or come to a
barrier, those at the least instruction go on together, so branches meet again where they end. An
instruction or an operand that is not known is an error, and so is a shuffle or a vote of a warp
that is not together.
"""

import re

import numpy as np

WARP = 32
ENDED = 1 << 30
LOW = np.uint64(0xFFFFFFFF)
COMPARISONS = {
    "eq": np.equal,
    "ne": np.not_equal,
    "neu": np.not_equal,
    "lt": np.less,
    "le": np.less_equal,
    "gt": np.greater,
    "ge": np.greater_equal,
    "leu": lambda x, y: ~(x > y),
    "ltu": lambda x, y: ~(x >= y),
    "geu": lambda x, y: ~(x < y),
    "gtu": lambda x, y: ~(x <= y),
}
ARITHMETIC = {
    "add": lambda x, y: x + y,
    "sub": lambda x, y: x - y,
    "mul": lambda x, y: x * y,
    "mad": lambda x, y, z: x * y + z,
    "fma": lambda x, y, z: x * y + z,
    "neg": lambda x: -x,
    "and": lambda x, y: x & y,
    "or": lambda x, y: x | y,
    "xor": lambda x, y: x ^ y,
    "not": lambda x: ~x,
    "shl": lambda x, y: x << y,
    "shr": lambda x, y: x >> y,
    "max": np.maximum,
    "min": np.minimum,
}


class Program:
    """The instructions of the kernel in a text of PTX."""

    def __init__(self, text):
        self.code, self.labels, self.shared, self.shared_bytes = [], {}, {}, 0
        for line in text[text.index(".entry") :].splitlines():
            line = line.split("//")[0].strip()
            if found := re.match(r"\.shared .*\.b8 (\S+)\[(\d+)\];", line):
                start = -(-self.shared_bytes // 16) * 16
                self.shared[found[1]], self.shared_bytes = start, start + int(found[2])
            elif found := re.match(r"(\$\w+):", line):
                self.labels[found[1]] = len(self.code)
            elif found := re.match(r"(?:@(!?%p\d+)\s+)?([a-z][\w.:]*)\s*(.*);", line):
                operands = [one.strip() for one in re.split(r",(?![^\[]*\])", found[3]) if one]
                self.code.append((found[1], found[2], operands))

    def run(self, blocks, threads, parameters, memory):
        """Runs a grid of one axis.

        Args:
            blocks: extent of the grid.
            threads: extent of a block.
            parameters: bytes of the parameter block, an array of uint8.
            memory: global memory, an array of uint8 whose first byte has the address 0.
        """
        for number in range(blocks):
            _Block(self, number, threads, parameters, memory).run()


def _bits(kind):
    return int(re.search(r"\d+$", kind)[0])


class _Block:
    def __init__(self, program, number, threads, parameters, memory):
        self.program, self.number, self.threads = program, number, threads
        # Shared memory begins with what nobody has written.
        shared = np.full(program.shared_bytes, 0xAB, np.uint8)
        self.memories = {"param": parameters, "global": memory, "shared": shared}
        self.registers = {}
        self.place = np.zeros(threads, int)
        self.waits = np.zeros(threads, bool)

    def run(self):
        while (self.place < ENDED).any():
            for first in range(0, self.threads, WARP):
                self.run_warp(np.arange(first, min(first + WARP, self.threads)))
            assert self.waits[self.place < ENDED].all()
            self.waits[:] = False

    def run_warp(self, lanes):
        """Until its threads have ended or come to a barrier."""
        while len(ready := lanes[(self.place[lanes] < ENDED) & ~self.waits[lanes]]):
            least = self.place[ready].min()
            some = ready[self.place[ready] == least]
            predicate, name, operands = self.program.code[least]
            self.place[some] = least + 1
            if predicate:
                holds = self.read(predicate.lstrip("!"), some) != 0
                some = some[holds ^ predicate.startswith("!")]
            if len(some):
                self.step(name, operands, some)

    def step(self, name, operands, lanes):
        first, *parts = name.split(".")
        if first in ARITHMETIC:
            return self.compute(first, parts, operands, lanes)
        getattr(self, f"do_{first}")(parts, operands, lanes)

    def read(self, operand, lanes, kind="u64"):
        """Values of lanes, of a type: bits are unsigned numbers."""
        places = {"%tid.x": lanes, "%ntid.x": self.threads, "%ctaid.x": self.number}
        places |= {"%laneid": lanes % WARP, "%ntid.y": 1, "%ntid.z": 1}
        if operand in self.registers:
            value = self.registers[operand][lanes]
        elif operand in places or operand in ("%tid.y", "%tid.z", "%ctaid.y", "%ctaid.z"):
            value = np.broadcast_to(places.get(operand, 0), lanes.shape).astype(np.uint64)
        elif found := re.fullmatch(r"0f([0-9A-Fa-f]{8})", operand):
            value = np.full(len(lanes), int(found[1], 16), np.uint64)
        elif re.fullmatch(r"-?\d+", operand):
            value = np.full(len(lanes), int(operand) & (1 << 64) - 1, np.uint64)
        else:
            # Parameters begin at zero.
            assert operand in self.program.shared or operand.endswith("_param_0"), operand
            value = np.full(len(lanes), self.program.shared.get(operand, 0), np.uint64)
        if kind == "f32":
            return value.astype(np.uint32).view(np.float32)
        if kind == "s32":
            return value.astype(np.uint32).view(np.int32).astype(np.int64)
        if _bits(kind) == 32:
            value = value & LOW
        return value.view(np.int64) if kind[0] == "s" else value

    def write(self, operand, lanes, value):
        register = self.registers.setdefault(operand, np.zeros(self.threads, np.uint64))
        if value.dtype == np.float32:
            value = value.view(np.uint32)
        register[lanes] = value.view(np.uint64) if value.dtype == np.int64 else value

    def memory(self, parts, operand, lanes):
        """The memory of an access, and the place of each lane in it."""
        (space,) = {"param", "global", "shared"} & set(parts)
        base, _, offset = operand.strip("[]").partition("+")
        return self.memories[space], self.read(base, lanes).view(np.int64) + int(offset or 0)

    def compute(self, name, parts, operands, lanes):
        kind = parts[-1]
        if kind == "pred":
            given = [self.read(one, lanes) != 0 for one in operands[1:]]
            return self.write(operands[0], lanes, ARITHMETIC[name](*given))
        if kind == "f32":
            given = [self.read(one, lanes, kind).astype(np.float64) for one in operands[1:]]
            value = ARITHMETIC[name](*given).astype(np.float32)
            return self.write(operands[0], lanes, value)
        signed = kind.replace("b", "u")
        given = [self.read(one, lanes, signed).view(np.int64) for one in operands[1:]]
        value = ARITHMETIC[name](*given).view(np.uint64)
        narrow = _bits(kind) == 32 and "wide" not in parts
        self.write(operands[0], lanes, value & LOW if narrow else value)

    def do_mov(self, parts, operands, lanes):
        self.write(operands[0], lanes, self.read(operands[1], lanes))

    def do_cvt(self, parts, operands, lanes):
        self.write(operands[0], lanes, self.read(operands[1], lanes, parts[-1]))

    def do_setp(self, parts, operands, lanes):
        x, y = (self.read(one, lanes, parts[-1].replace("b", "u")) for one in operands[1:])
        self.write(operands[0], lanes, COMPARISONS[parts[0]](x, y))

    def do_selp(self, parts, operands, lanes):
        x, y, condition = (self.read(one, lanes) for one in operands[1:])
        self.write(operands[0], lanes, np.where(condition != 0, x, y))

    def do_ld(self, parts, operands, lanes):
        memory, places = self.memory(parts, operands[1], lanes)
        size = _bits(parts[-1]) // 8
        value = np.array([int.from_bytes(memory[p : p + size].tobytes(), "little") for p in places])
        self.write(operands[0], lanes, value.astype(np.uint64))

    def do_st(self, parts, operands, lanes):
        memory, places = self.memory(parts, operands[0], lanes)
        size = _bits(parts[-1]) // 8
        for place, value in zip(places, self.read(operands[1], lanes), strict=True):
            assert 0 <= place <= len(memory) - size
            memory[place : place + size] = np.frombuffer(
                int(value).to_bytes(8, "little"), np.uint8
            )[:size]

    def do_red(self, parts, operands, lanes):
        assert parts[-2:] == ["add", "f32"]
        memory, places = self.memory(parts, operands[0], lanes)
        for place, value in zip(places, self.read(operands[1], lanes, "f32"), strict=True):
            memory[place : place + 4].view(np.float32)[0] += value

    def do_bra(self, parts, operands, lanes):
        self.place[lanes] = self.program.labels[operands[0]]

    def do_ret(self, parts, operands, lanes):
        self.place[lanes] = ENDED

    def do_bar(self, parts, operands, lanes):
        if parts[0] == "warp":
            assert len(lanes) == WARP
        else:
            self.waits[lanes] = True

    def do_griddepcontrol(self, parts, operands, lanes):
        pass

    def do_activemask(self, parts, operands, lanes):
        mask = sum(1 << int(lane) for lane in lanes % WARP)
        self.write(operands[0], lanes, np.full(len(lanes), mask, np.uint64))

    def do_vote(self, parts, operands, lanes):
        assert len(lanes) == WARP and parts[:2] == ["sync", "all"]
        self.write(operands[0], lanes, np.full(WARP, self.read(operands[1], lanes).all()))

    def do_shfl(self, parts, operands, lanes):
        assert len(lanes) == WARP
        number = self.read(operands[2], lanes).view(np.int64)
        source = np.arange(WARP) ^ number if parts[1] == "bfly" else number % WARP
        self.write(operands[0].split("|")[0], lanes, self.read(operands[1], lanes)[source])
