"""Random kernels whose threads diverge, gather, loop and mix types; none races with another.

Threads read inputs wherever they like, write elements that are theirs alone, and update common ones
by operations whose order does not matter. So results are defined whatever runs threads, and in
which order: they are compared bit for bit between ways to run them, and with threads_reference.py.
Products of floats pass through `min` before they are added, so that none can become an `fma`.
"""

import math
import random

import numpy as np

import threads_reference as reference
import warp as wp

INDENT = "    "
SIGNED = ("int8", "int16", "int32", "int64")
INTS = SIGNED + ("uint8", "uint16", "uint32", "uint64")
FLOATS = ("float32", "float64", "float16")
# Name, element, shape for n threads, values.
INPUTS = (
    *((f"r{k}", f"wp.{name}", "2 * n + 8", "any") for k, name in enumerate(INTS)),
    *((f"x{k}", f"wp.{name}", "2 * n + 8", "quarters") for k, name in enumerate(FLOATS)),
    ("near", "wp.int32", "2 * n + 8", "places"),
    ("points", "wp.vec3", "2 * n + 8", "quarters"),
    ("turns", "wp.mat22", "2 * n + 8", "quarters"),
    ("things", "Thing", "2 * n + 8", "things"),
)
OUTPUTS = (
    ("o32", "wp.int32", "2 * n + 8", "any"),
    ("o8", "wp.int8", "2 * n + 8", "any"),
    ("o64", "wp.int64", "2 * n + 8", "any"),
    ("of", "wp.float32", "2 * n + 8", "quarters"),
    ("od", "wp.float64", "2 * n + 8", "quarters"),
    ("oh", "wp.float16", "2 * n + 8", "quarters"),
    ("ov", "wp.vec3", "2 * n + 8", "quarters"),
    ("ot", "Thing", "2 * n + 8", "things"),
    ("rows", "wp.int32", "(n, 4)", "any"),
    ("counts", "wp.int32", "8", "zero"),
    ("wide", "wp.int64", "8", "zero"),
    ("bits", "wp.uint32", "8", "zero"),
    ("flips", "wp.int32", "8", "zero"),
    ("least", "wp.int32", "8", "zero"),
    ("most", "wp.float32", "8", "zero"),
    ("sums", "wp.float32", "8", "zero"),
)
ARRAYS = INPUTS + OUTPUTS
ELEMENTS = {name: element for name, element, *_ in ARRAYS}
PRELUDE = """
Local = wp.types.vector(8, wp.int32)


@wp.struct
class Thing:
    a: int
    p: wp.vec3
    c: wp.float64


@wp.func
def collatz(start: int, limit: int):
    n = start
    k = int(0)
    while n > 1:
        if k >= limit:
            return -k
        if (n & 1) == 0:
            n = n // 2
        else:
            n = 3 * n + 1
        k += 1
    return k


@wp.func
def soften(x: float, limit: float):
    if x < -limit:
        return -limit
    if x > limit:
        return limit
    return x / (1.0 + wp.abs(x))
"""
HEADS = {
    1: ["i = wp.tid()"],
    2: ["r, c = wp.tid()", "i = r * w + c"],
    3: ["q, r, c = wp.tid()", "i = (q * h + r) * w + c"],
}


def numbers(kind, shape, dtype, random):
    """Numbers for an array: small ones, extreme ones among integers."""
    if kind == "zero":
        return np.zeros(shape, dtype)
    if kind == "quarters":
        return (random.integers(-20, 20, shape) / 4).astype(dtype)
    info = np.iinfo(dtype)
    small = random.integers(0 if info.min == 0 else -9, 10, shape, dtype)
    every = random.integers(info.min, info.max, shape, dtype, endpoint=True)
    return np.where(random.random(shape) < 0.7, small, every)


def things(shape, element, random):
    """An array of the struct of the prelude."""
    made = np.zeros(shape, element.numpy_dtype())
    made["a"] = random.integers(-9, 9, shape)
    made["p"] = random.integers(-20, 20, (*shape, 3)) / 4
    made["c"] = random.integers(-20, 20, shape) / 4
    return made


def fill(space, n, seed):
    """Values of all arrays for n threads, by name; `space` has the kernel's types."""
    random = np.random.default_rng(seed)
    made = {}
    for name, element, extent, kind in ARRAYS:
        shape = eval(extent, {"n": n})
        shape = shape if isinstance(shape, tuple) else (shape,)
        dtype = eval(element, space)
        if kind == "places":
            made[name] = random.integers(0, max(n, 1), shape, np.int32)
        elif kind == "things":
            made[name] = things(shape, dtype, random)
        elif dtype in (wp.vec3, wp.mat22):
            made[name] = numbers(kind, shape + dtype._shape_, np.float32, random)
        else:
            made[name] = numbers(kind, shape, wp.dtype_to_numpy(dtype), random)
    return made


def extents(dim):
    """Threads of a launch, and its last two extents."""
    return math.prod(dim), (1, *dim)[-2], dim[-1]


def run(space, dim, seed, device):
    """Outputs of a launch, by name."""
    n, h, w = extents(dim)
    arrays = {
        name: wp.array(data, dtype=eval(ELEMENTS[name], space), device=device)
        for name, data in fill(space, n, seed).items()
    }
    wp.launch(space["k"], dim, [*arrays.values(), n, h, w], device=device)
    return {name: arrays[name].numpy() for name, *_ in OUTPUTS}


def expect(text, space, dim, seed):
    """The reference's result of the same program."""
    n, h, w = extents(dim)
    names = reference.load(text)
    host = fill(space, n, seed)
    arrays = [reference.Array(one, eval(ELEMENTS[name], names)) for name, one in host.items()]
    reference.launch(names["k"], dim, [*arrays, *map(np.int32, (n, h, w))])
    return {name: host[name] for name, *_ in OUTPUTS}


class Program:
    """Source of one kernel `k(arrays, n, h, w)` for n threads, the last extents being h and w.

    Args:
        seed: what the choices follow from.
        rank: of the launch.
        exact: whether all arithmetic is such that Python's gives the same bits: no sine, no product
            that may become part of an `fma`.
        short: whether there are few statements, as vectorisers like it.

    Attributes:
        text: the source.
    """

    def __init__(self, seed, rank=1, exact=True, short=False):
        self.random = random.Random(seed)
        self.rank, self.exact, self.short = rank, exact, short
        self.lines: list = []
        self.depth, self.loops, self.names = 1, 0, 0
        kinds = ["int32", *self.random.sample(INTS, 3)]
        self.ints = dict(zip("abdf", kinds, strict=True))
        self.floats = dict(zip("xyz", FLOATS, strict=True))
        self._write()
        self.text = PRELUDE + "\n\n" + "\n".join(self.lines) + "\n"

    def _add(self, line):
        self.lines.append(INDENT * self.depth + line)

    def _pick(self, *choices):
        return self.random.choice(choices)

    def _write(self):
        shaped = {"rows": "array2d"}
        parameters = [
            f"{name}: wp.{shaped.get(name, 'array')}(dtype={element})"
            for name, element, _, _ in ARRAYS
        ]
        self.lines += ["@wp.kernel(module_options=OPTIONS)", "def k("]
        self.lines += [f"{INDENT}{one}," for one in [*parameters, "n: int", "h: int", "w: int"]]
        self.lines.append("):")
        for line in HEADS[self.rank]:
            self._add(line)
        for name, kind in self.ints.items():
            self._add(f"{name} = r{INTS.index(kind)}[{self._index()}]")
        for name, kind in self.floats.items():
            self._add(f"{name} = x{FLOATS.index(kind)}[{self._index()}]")
        self._add(f"p = points[{self._index()}]")
        self._add(f"t = things[{self._index()}]")
        self._add("s = Local()")
        self._block(*((2, self.random.randint(1, 2)) if self.short else (3, 7)))
        kinds = (("of", "float32"), ("od", "float64"), ("oh", "float16"))
        stores = ["o32[i] = a + s[a & 7] + t.a", f"o64[i] = wp.int64({self._pick(*self.ints)})"]
        stores += [f"{name}[i] = {self._real(kind, 1)}" for name, kind in kinds] + ["ov[i] = p"]
        for line in self.random.sample(stores, 1 if self.short else len(stores)):
            self._add(line)

    def _index(self, counter=None):
        """A place in an input."""
        near = ("near[i]", "near[i + i]", "near[near[i]]", "near[n - 1 - i]")
        plain = ("i", "i + i", "2 * i + 1", "i + 1", "n - 1 - i", "-1 - i", "i - n")
        mixed = ("(i * 7 + 3) % n", "wp.mod(i * 1664525 + 1013904223, 7)", "i // 3 + i % 2")
        loop = ()
        if counter:
            loop = tuple(
                form.format(counter)
                for form in ("i + {0} % 5", "near[(i + {0}) % n]", "{0} % 2 * n + i", "{0} % 8")
            )
        return self._pick(*near, *plain, *mixed, *loop, *loop, *loop)

    def _counter(self):
        """The counter of a loop around here, if there is one."""
        return f"k{self.random.randrange(self.loops)}" if self.loops else None

    def _integer(self, kind, depth):
        """An expression of an integer type."""
        same = [name for name, other in self.ints.items() if other == kind]
        if depth == 0 or self.random.random() < 0.2:
            place = self._index(self._counter())
            leaves = [
                f"wp.{kind}({self.random.randrange(10)})",
                f"wp.{kind}({self._pick('a', 'i')})",
            ]
            leaves += [f"r{INTS.index(kind)}[{place}]", f"wp.{kind}(x)", *same, *same]
            if kind == "int32":
                leaves += ["s[a & 7]", "t.a", "o32[i]"]
                leaves += [
                    "collatz(a & 63, wp.int32(20))",
                    "int(wp.dot(points[near[i]], points[i]))",
                ]
            return self._pick(*leaves)
        one, other = self._integer(kind, depth - 1), self._integer(kind, depth - 1)
        forms = ["({0} + {1})", "({0} - {1})", "({0} * {1})", "({0} & {1})", "({0} ^ {1})"]
        forms += ["wp.div({0}, {1})", "wp.mod({0}, {1})", "({0} // {1})", "({0} | {1})"]
        forms += ["wp.min({0}, {1})", "wp.max({0}, {1})", "({0} if {2} else {1})"]
        forms += [f"({{0}} {self._pick('<<', '>>')} wp.{kind}({self.random.randrange(70)}))"]
        forms += ["wp.where({2}, {0}, {1})"] + (["wp.abs({0})"] if kind in SIGNED else [])
        return self._pick(*forms).format(one, other, self._condition(depth - 1))

    def _real(self, kind, depth):
        """An expression of a float type."""
        same = [name for name, other in self.floats.items() if other == kind]
        if depth == 0 or self.random.random() < 0.2:
            place = self._index(self._counter())
            quarter = self.random.randrange(-20, 20) / 4
            leaves = [f"wp.{kind}({quarter})", f"x{FLOATS.index(kind)}[{place}]", *same, *same]
            leaves += [f"wp.{kind}(a & wp.int32(63))"]
            if kind == "float32":
                leaves += [
                    "p[1]",
                    "soften(x, wp.float32(2.0))",
                    "wp.float32(y)",
                    f"turns[{place}][1, 0]",
                ]
            return self._pick(*leaves)
        one, other = self._real(kind, depth - 1), self._real(kind, depth - 1)
        forms = ["({0} + {1})", "({0} - {1})", f"wp.min({{0}} * {{1}}, wp.{kind}(64.0))"]
        if not self.exact:
            forms += ["{0} * {1}", "({0} * {1} + {0})", "({1} - {0} * {1})", "wp.sin({0})"]
            forms += ["wp.exp(wp.min({0}, {1}))", "wp.log(wp.abs({0}))", "({0} * {0} - {1} * {1})"]
        forms += [f"({{0}} / (wp.abs({{1}}) + wp.{kind}(1.0)))", "wp.sqrt(wp.abs({0}))"]
        forms += ["wp.min({0}, {1})", "wp.max({0}, {1})", "({0} if {2} else {1})"]
        return self._pick(*forms).format(one, other, self._condition(depth - 1))

    def _condition(self, depth):
        depth = max(depth, 0)
        if self.random.random() < 0.3:
            kind = self._pick(*FLOATS)
            left, right = (self._real(kind, depth) for _ in range(2))
        else:
            kind = self._pick(*self.ints.values())
            left, right = (self._integer(kind, depth) for _ in range(2))
        text = f"{left} {self._pick('<', '<=', '>', '>=', '==', '!=')} {right}"
        form = self._pick("{0}", "{0}", "not ({0})", "({0} and {1})", "({0} or {1})", "{1}")
        # The load is out of bounds in threads that the first half keeps away.
        guarded = f"a >= 0 and a < n and r0[a] > wp.int8({self.random.randrange(-50, 50)})"
        return form.format(text, f"({guarded})")

    def _block(self, depth, statements):
        for _ in range(statements):
            kinds = ["_assign"] * 4 + ["_store"] * 2 + ["_update"] * 2 + ["_part"] * 2
            if depth > 0:
                kinds += ["_branch"] * 3 + (["_for", "_for", "_while"] if self.loops < 2 else [])
            if self.random.random() < 0.1:
                kinds = ["_leave"]
            getattr(self, self._pick(*kinds))(depth)

    def _nested(self, header, depth):
        self._add(header)
        self.depth += 1
        self._block(depth - 1, self.random.randint(1, 3))
        self.depth -= 1

    def _assign(self, depth):
        if self.random.random() < 0.6:
            name = self._pick(*self.ints)
            self._add(f"{name} = {self._integer(self.ints[name], 2)}")
        else:
            name = self._pick(*self.floats)
            self._add(f"{name} = {self._real(self.floats[name], 2)}")

    def _store(self, depth):
        integer, real = self._integer("int32", 1), self._real("float32", 1)
        self._add(
            self._pick(
                f"o32[i] = {integer}",
                f"o32[n + i] = o32[i] + {integer}",
                f"o8[{self._pick('i + i', '2 * i + 1')}] = {self._integer('int8', 1)}",
                f"of[{self._pick('i', 'n + i')}] = {real}",
                f"rows[i, {self._pick('0', '3', 'a & 3', '-2')}] = {integer}",
                "ot[n - 1 - i] = t",
                "ov[i] = points[near[i]]",
                f"ov[i][{self._pick('0', '2', 'a & 1')}] = {real}",
            )
        )

    def _update(self, depth):
        place = self._pick("0", "i % 8", "a & 7", "near[i] % 8", "7 - i % 2")
        integer = self._integer("int32", 1)
        self._add(
            self._pick(
                f"wp.atomic_add(counts, {place}, {integer})",
                f"wp.atomic_sub(counts, {place}, {integer})",
                f"wp.atomic_add(wide, {place}, {self._integer('int64', 1)})",
                f"wp.atomic_or(bits, {place}, {self._integer('uint32', 1)})",
                f"wp.atomic_xor(flips, {place}, {integer})",
                f"wp.atomic_min(least, {place}, {integer})",
                f"wp.atomic_max(most, {place}, wp.float32({integer}))",
                f"wp.atomic_add(sums, {place}, wp.float32({integer} & wp.int32(7)) * 0.25)",
            )
        )

    def _part(self, depth):
        """Composites: vectors, a local array, a struct."""
        place = self._index(self._counter())
        small = f"wp.float32({self._integer('int32', 1)} & wp.int32(15))"
        self._add(
            self._pick(
                f"s[{self._pick('a', 'i', '(a + i)')} & 7] = {self._integer('int32', 1)}",
                f"p = points[{place}]",
                f"p = wp.vec3({small}, p[{self._pick('0', '2', 'i % 3')}], 1.5)",
                f"p[{self._pick('0', '1', 'i % 3')}] = {self._real('float32', 1)}",
                "p = points[i] - points[i + 1] * 0.5",
                f"t = things[{place}]",
                f"t.a = {self._integer('int32', 1)}",
                f"t.c = {self._real('float64', 1)}",
                f"t.p = points[{place}]",
                f"x = wp.dot(points[i], wp.vec3(1.0, 2.0, {small}))",
            )
        )

    def _branch(self, depth):
        self._nested(f"if {self._condition(1)}:", depth)
        if self.random.random() < 0.3:
            self._nested(f"elif {self._condition(1)}:", depth)
        if self.random.random() < 0.5:
            self._nested("else:", depth)

    def _for(self, depth):
        bounds = ("3", "a & 7", "1, 6, 2", "i % 5", "4, -1, -2", "i % 3, 6", "i & 1, a & 15, 3")
        header = f"for k{self.loops} in range({self._pick(*bounds)}):"
        self.loops += 1
        self._nested(header, depth)
        self.loops -= 1

    def _while(self, depth):
        counter = f"k{self.loops}"
        self._add(f"{counter} = int(0)")
        self._add(
            f"while {counter} < {self._pick('5', '(a & 7)', 'i % 7')} and {self._condition(0)}:"
        )
        self.depth += 1
        self._add(f"{counter} += 1")
        self.loops += 1
        self._block(depth - 1, self.random.randint(1, 3))
        self.loops -= 1
        self.depth -= 1

    def _leave(self, depth):
        kinds = ["return"] + (["break", "continue"] * 2 if self.loops else [])
        self._add(f"if {self._condition(0)}:")
        self._add(INDENT + self._pick(*kinds))
