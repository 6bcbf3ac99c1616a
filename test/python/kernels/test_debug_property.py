"""Random programs with indices that may be out of bounds: debug mode reports exactly these, and
computes otherwise what release mode does."""

import random

import numpy as np
import pytest

import warp as wp
from frontend_programs import define
from random_runs import seeds

# The indexed objects: how each is made, its extents, and the code that writes to it.
PLACES = {
    "v": ("wp.vec3(1.0, 2.0, 3.0)", (3,)),
    "m": ("wp.mat22(1.0, 2.0, 3.0, 4.0)", (2, 2)),
    "q": ("wp.quat(1.0, 2.0, 3.0, 4.0)", (4,)),
    "h": ("wp.zeros(shape=(2, 3), dtype=float)", (2, 3)),
    "t": ("wp.tile_ones(shape=4, dtype=float)", (4,)),
}
HEAD = """
@wp.kernel
def kernel(n: wp.array(dtype=int), a: wp.array(dtype=wp.vec3), b: wp.array2d(dtype=float),
           o: wp.array(dtype=float)):
    s = float(0.0)
"""


class Program:
    """Source text, and what Python finds of it: the result, or that an index is out of bounds."""

    def __init__(self, seed):
        self.random = random.Random(seed)
        self.chance = self.random.choice([0.0, 0.04, 0.1])
        # The compiler knows none of these.
        self.numbers = list(range(-9, 10))
        self.text = HEAD + "".join(f"    {one} = {made}\n" for one, (made, _) in PLACES.items())
        self.state = {one: np.zeros(extents) for one, (_, extents) in PLACES.items()}
        self.state["v"][:], self.state["q"][:] = [1, 2, 3], [1, 2, 3, 4]
        self.state["m"][:], self.state["t"][:] = [[1, 2], [3, 4]], 1
        self.state["a"], self.state["b"] = np.ones((2, 3)), np.ones((3, 2))
        self.sum, self.failed = 0.0, False
        for _ in range(self.random.randint(2, 8)):
            self.statement()
        self.text += "    o[0] = s\n"

    def index(self, extent):
        out = self.random.random() < self.chance
        choices = [extent, -extent - 1, extent + 1] if out else range(-extent, extent)
        number = self.random.choice(list(choices))
        self.failed |= out
        return number, f"n[{self.numbers.index(number)}]"

    def place(self):
        name = self.random.choice([*self.state])
        numbers, texts = zip(*(self.index(n) for n in self.state[name].shape), strict=True)
        joined = "][".join(texts) if name == "a" else ", ".join(texts)
        return self.state[name], numbers, f"{name}[{joined}]"

    def statement(self):
        failed = self.failed
        array, at, text = self.place()
        kind = self.random.choice(["read", "write", "add"])
        value = float(self.random.randint(1, 9))
        if kind == "read":
            self.text += f"    s += {value} * {text}\n"
        else:
            self.text += f"    {text} {'=' if kind == 'write' else '+='} {value}\n"
            # Unread elements are checked, too.
            if self.random.random() < 0.5:
                self.text += f"    s += {text}\n"
                kind += " and read"
        if failed or self.failed:
            return
        if kind.startswith("write"):
            array[at] = value
        elif kind.startswith("add"):
            array[at] += value
        if kind.endswith("read"):
            self.sum += array[at] * (value if kind == "read" else 1)


@pytest.mark.parametrize("seed", seeds(24))
def test_random_programs(device, monkeypatch, seed):
    program = Program(seed)
    for mode in ("release", "debug"):
        if mode == "release" and program.failed:
            continue
        monkeypatch.setattr(wp.config, "mode", mode)
        kernel = define(program.text)["kernel"]
        n = wp.array(program.numbers, dtype=int, device=device)
        a, b = wp.ones(2, dtype=wp.vec3, device=device), wp.ones((3, 2), dtype=float, device=device)
        o = wp.zeros(1, dtype=float, device=device)
        inputs = [n, a, b, o]
        if program.failed:
            with pytest.raises(wp.WarpLaunchError, match="out of bounds"):
                wp.launch(kernel, 1, inputs, block_dim=1, device=device)
                wp.synchronize()
            continue
        wp.launch(kernel, 1, inputs, block_dim=1, device=device)
        wp.synchronize()
        assert o.numpy()[0] == program.sum, program.text
        np.testing.assert_array_equal(a.numpy(), program.state["a"], err_msg=program.text)
        np.testing.assert_array_equal(b.numpy(), program.state["b"], err_msg=program.text)
