"""Random programs of the shapes that users write, as text that every package runs."""

import random
from dataclasses import dataclass, replace

import _program_parts as parts

# Operations of a launch, at most, by kind of device.
MOST = {"cpu": 4e7, "cuda": 2e8}
SIZES = {"cpu": (0, 20), "cuda": (8, 24)}


@dataclass(frozen=True)
class Program:
    """A kernel: parts one after the other, and how its number leaves it.

    Args:
        names: functions of `_program_parts`, with the seed of each one's own choices.
        end: a key of `ENDS`.
        scalar: name of the scalar type.
        size: threads.
    """

    names: tuple
    end: str
    scalar: str
    size: int

    def title(self):
        inner = ", ".join(name for name, _ in self.names)
        return f"{inner or 'copy'} -> {self.end}, {self.size} x {self.scalar}"

    def smaller(self):
        """Programs with one part less, then the one that only stores."""
        for k in range(len(self.names)):
            yield replace(self, names=self.names[:k] + self.names[k + 1 :])
        if self.end != "store":
            yield replace(self, end="store")

    def made(self):
        """The parts with their numbers."""
        for n, (name, seed) in enumerate(self.names):
            yield n, getattr(parts, name)(random.Random(seed).choice)

    def text(self, name):
        """A module that registers the case `name`."""
        line, given, results = parts.ENDS[self.end]
        arguments = [("x", "wp.array(dtype=T)", "data.real(N, T)")]
        before, body = [], ["i = wp.tid()", "a = x[i]"]
        for n, part in self.made():
            number = {"n": n}
            arguments += [tuple(one.format(**number) for one in each) for each in part.arguments]
            before.append(part.before.format(**number))
            body += part.lines.format(**number).splitlines()
        arguments += given
        body.append(line)
        inputs = [one for one in arguments if not one[2].startswith("data.out")]
        outputs = [one for one in arguments if one[2].startswith("data.out")]
        outputs.append(("out", "wp.array(dtype=T)", f"data.out({results}, T)"))
        declared = ", ".join(f"{one}: {kind}" for one, kind, _ in [*inputs, *outputs])
        lines = [
            f'"""{self.title()}"""',
            "import numpy as np",
            "import warp as wp",
            "from _shape_data import Case, case, differentiable",
            f"T, N = wp.{self.scalar}, {self.size}",
            "N_ = wp.constant(N)",
            *dict.fromkeys(before),
            "@differentiable",
            f"def kernel({declared}):",
            *(f"    {one}" for one in body),
            "@case",
            f"def {name}(data):",
            f"    inputs = [{', '.join(one[2] for one in inputs)}]",
            f"    outputs = [{', '.join(one[2] for one in outputs)}]",
            "    return Case(kernel, N, inputs, outputs, N, smooth=False)",
        ]
        return "\n".join(lines) + "\n"


def make(seed, kind):
    """The program of a seed, for devices of a kind."""
    rng = random.Random(seed)
    names = tuple(
        (rng.choice(parts.PARTS).__name__, rng.randrange(1000)) for _ in range(rng.randint(1, 4))
    )
    scalar = rng.choice(["float32", "float32", "float32", "float64"])
    program = Program(names, rng.choice(list(parts.ENDS)), scalar, 1)
    work = 4 + sum(part.weight for _, part in program.made())
    largest = int(MOST[kind] / work)
    low, high = SIZES[kind]
    size = min(int(2 ** rng.uniform(low, high)), largest)
    # Sizes of users are round as often as not.
    if rng.random() < 0.5 and size > 32:
        size = 1 << (size.bit_length() - 1)
    if program.end == "strided" and size % 7 == 0:
        # Each thread has an element of its own.
        size += 1
    return replace(program, size=max(size, 1))
