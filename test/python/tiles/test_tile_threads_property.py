"""Random programs: threads of blocks, the last one ragged, change parts of elements of a tile."""

import random

import numpy as np
import pytest
from support.block_program import run_launch

import warp as wp
from frontend_programs import define
from random_runs import seeds

HEAD = """
@wp.kernel
def kernel(x: wp.array(dtype=float), at: wp.array2d(dtype=int), o: wp.array(dtype=wp.vec{length}),
           s: wp.array(dtype=float)):
    i = wp.tid()
    lane = i % {threads}
    v = x[i]
    t = wp.tile_zeros(shape={elements}, dtype=wp.vec{length})
"""
TAIL = """    {store}
    s[i] = v
"""


class Program:
    """Source text, and what NumPy computes for it."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.length = self.random.choice([2, 3, 4])
        self.threads = self.random.choice([2, 3, 4, 6, 8])
        self.elements = -(-self.threads // self.length) + self.random.randrange(3)
        self.count = self.random.randrange(1, 3 * self.threads + 1)
        self.steps = [self.random.choice(["set", "+=", "-=", "read", "return"])
                      for _ in range(self.random.randint(2, 6))]  # fmt: skip
        self.by_threads = self.random.random() < 0.4
        rows = []
        for step in self.steps:
            places = [(e, c) for e in range(self.elements) for c in range(self.length)]
            # Threads that assign have a part each.
            if step == "set":
                chosen = self.random.sample(places, self.threads)
            else:
                chosen = [self.random.choice(places) for _ in range(self.threads)]
            # Some count from the end.
            chosen = [(e - self.elements * self.random.randrange(2),
                       c - self.length * self.random.randrange(2)) for e, c in chosen]  # fmt: skip
            rows.append([number for place in chosen for number in place])
        blocks = -(-self.count // self.threads)
        room = blocks * max(self.elements, self.threads)
        self.room = room
        self.spots = self.random.sample(range(room), blocks * self.threads)
        width = max(len(self.spots), 2 * self.threads)
        rows.append(self.spots)
        self.table = np.array([row + [0] * (width - len(row)) for row in rows], dtype=np.int32)
        self.x = np.array([self.random.randint(-8, 8) for _ in range(self.count)], dtype=np.float32)

    def source(self):
        lines = [HEAD.format(**vars(self))]
        for k, step in enumerate(self.steps):
            place = f"t[at[{k}, 2 * lane]][at[{k}, 2 * lane + 1]]"
            lines.append({
                "set": f"    {place} = v + {k}.0\n",
                "+=": f"    {place} += v\n",
                "-=": f"    {place} -= 2.0 * v\n",
                "read": f"    v = {place} - v\n",
                "return": f"    if v == {k}.0:\n        return\n",
            }[step])  # fmt: skip
        store = (
            f"wp.tile_store(o, wp.tile_ones({self.threads}, dtype=wp.vec{self.length}) * v, "
            f"offset=at[{len(self.steps)}, i] - lane)"
            if self.by_threads
            else f"wp.tile_store(o, t, offset=i / {self.threads} * {self.elements})"
        )
        return "".join(lines) + TAIL.format(store=store)

    def expected(self):
        o = np.full((self.room, self.length), -99.0)
        s = np.full(self.count, -99.0)
        v = self.x.astype(float)
        for first in range(0, self.count, self.threads):
            live = list(range(first, min(first + self.threads, self.count)))
            t = np.zeros((self.elements, self.length))
            for k, step in enumerate(self.steps):
                old = t.copy()
                for i in list(live):
                    e, c = self.table[k, 2 * (i - first) : 2 * (i - first) + 2]
                    if step == "set":
                        t[e, c] = v[i] + k
                    elif step == "+=":
                        t[e, c] += v[i]
                    elif step == "-=":
                        t[e, c] -= 2 * v[i]
                    elif step == "read":
                        v[i] = old[e, c] - v[i]
                    elif step == "return" and v[i] == k:
                        live.remove(i)
            if live and not self.by_threads:
                o[first // self.threads * self.elements :][: self.elements] = t
            for i in live:
                s[i] = v[i]
                if self.by_threads:
                    o[self.spots[i]] = v[i]
        return o, s


@pytest.mark.parametrize("seed", seeds(14))
def test_random_programs(device, monkeypatch, seed):
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)
    program = Program(seed)
    source = program.source()
    kernel = define(source)["kernel"]
    o = np.full((program.room, program.length), -99, dtype=np.float32)
    s = np.full(program.count, -99, dtype=np.float32)
    given = [program.x, program.table, o, s]
    kinds = [wp.float32, wp.int32, wp.types.vector(program.length, wp.float32), wp.float32]
    arrays = [wp.array(one, dtype=kind, device=device)
              for one, kind in zip(given, kinds, strict=True)]  # fmt: skip
    wp.launch(kernel, program.count, arrays, block_dim=program.threads, device=device)
    for got, expected in zip(arrays[2:], program.expected(), strict=True):
        np.testing.assert_array_equal(got.numpy(), expected, err_msg=source)
    if seed % 3 == 0:
        run_launch(kernel, given, program.count, program.threads, seed)
        for got, expected in zip(given[2:], program.expected(), strict=True):
            np.testing.assert_array_equal(got, expected, err_msg=source)
