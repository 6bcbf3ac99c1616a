"""Derivatives of a builtin as a matrix: by adjoints, by tangents and by differences.

A program runs one overload of a builtin in f64 on many sets of operands at once. All its operands
together are one row of numbers per set, and so are its results.
"""

import re

import numpy as np
from warp._src.builtin_table import BUILTINS, SMOOTH_DOMAINS

import warp as wp
from frontend_programs import define

COUNT = 12
EXTENTS = {"n": 3, "r": 3, "c": 2, "k": 4}
SCALARS = {"bool": wp.bool, "int32": wp.int32, "uint32": wp.uint32, "float32": wp.float32}


def split(text):
    """Parts between commas that are not within brackets."""
    return re.findall(r"(?:[^,<>]|<[^<>]*>)+", text)


def parse_type(text):
    """The Python type of a pattern such as `vec<n, F>`, with f64 for numbers."""
    text = text.strip()
    if "<" not in text:
        if text in ("I", "J"):
            return wp.int32
        return SCALARS.get(text, wp.float64)
    kind, inner = re.fullmatch(r"(\w+)<(.*)>", text).groups()
    *extents, scalar = (part.strip() for part in inner.split(","))
    extents = [EXTENTS.get(extent) or int(extent) for extent in extents]
    scalar = SCALARS.get(scalar, wp.float64)
    if kind == "vec":
        return wp.types.vector(length=extents[0], dtype=scalar)
    if kind == "mat":
        return wp.types.matrix(shape=tuple(extents), dtype=scalar)
    return {"quat": wp.quatd, "transform": wp.transformd}[kind]


def components(dtype):
    shape = getattr(dtype, "_shape_", ())
    return int(np.prod(shape))


def is_float(dtype):
    return getattr(dtype, "_wp_scalar_type_", dtype) in (wp.float64, wp.float32)


def agree(coarse, fine, tolerance):
    """Rows where differences of two steps are the same: there is no branch or jump near."""
    coarse, fine = coarse.reshape(COUNT, -1), fine.reshape(COUNT, -1)
    scale = 1 + np.abs(fine).max(axis=1, keepdims=True)
    return (np.abs(coarse - fine) / scale).max(axis=1) < tolerance / 8


class Overload:
    """One overload of a builtin as a kernel."""

    def __init__(self, name, index, symmetric=None):
        self.name = name
        text = BUILTINS[name][2][index]
        parameters, results = re.fullmatch(r"\((.*)\) -> (.*)", text).groups()
        self.types, self.inout = [], []
        for position, parameter in enumerate(split(parameters)):
            pattern = parameter.split(":")[1].split("=")[0].strip()
            if pattern.startswith("inout "):
                self.inout.append(position)
            self.types.append(parse_type(pattern.removeprefix("inout ")))
        results = results[1:-1] if results.startswith("(") else results
        self.direct = [parse_type(one) for one in split(results)]
        self.results = self.direct + [self.types[i] for i in self.inout]
        self.kernel = self._define()
        self.symmetric = symmetric
        single = any(getattr(t, "_wp_scalar_type_", t) is wp.float32 for t in self.types)
        # Steps of differences, and what may be expected of them.
        self.steps, self.tolerance = ((0.04, 0.02), 1e-2) if single else ((1e-3, 1e-4), 1e-6)
        self.rounding = np.finfo(np.float32 if single else np.float64).eps

    @property
    def is_smooth(self):
        return any(map(is_float, self.types)) and any(map(is_float, self.results))

    def _define(self):
        names = {f"T{i}": t for i, t in enumerate(self.types)}
        names |= {f"R{i}": t for i, t in enumerate(self.results)}
        arrays = [f"p{i}: wp.array(dtype=T{i})" for i in range(len(self.types))]
        arrays += [f"o{i}: wp.array(dtype=R{i})" for i in range(len(self.results))]
        lines = ["@wp.kernel", f"def apply({', '.join(arrays)}):", "    i = wp.tid()"]
        lines += [f"    a{k} = p{k}[i]" for k in range(len(self.types))]
        call = f"wp.{self.name}({', '.join(f'a{k}' for k in range(len(self.types)))})"
        direct = ", ".join(f"r{k}" for k in range(len(self.direct)))
        lines.append(f"    {direct} = {call}" if direct else f"    {call}")
        values = [f"r{k}" for k in range(len(self.direct))] + [f"a{k}" for k in self.inout]
        lines += [f"    o{k}[i] = {value}" for k, value in enumerate(values)]
        return define("\n".join(lines) + "\n", **names)["apply"]

    def _define_sum(self):
        """A kernel that adds up the results, each component times a weight."""
        floats = [t for t in self.results if is_float(t)]
        names = {f"R{i}": t for i, t in enumerate(floats)}
        arrays = [f"{k}{i}: wp.array(dtype=R{i})" for i in range(len(floats)) for k in "ow"]
        lines = ["@wp.kernel", f"def add_up({', '.join(arrays)}, s: wp.array(dtype=wp.float64)):"]
        lines += ["    i = wp.tid()", "    t = wp.float64(0.0)"]
        for k, dtype in enumerate(floats):
            for index in np.ndindex(getattr(dtype, "_shape_", ())):
                at = f"[{', '.join(map(str, index))}]" if index else ""
                lines += [f"    r{k} = o{k}[i]", f"    v{k} = w{k}[i]"]
                lines.append(f"    t += wp.float64(r{k}{at} * v{k}{at})")
        lines.append("    wp.atomic_add(s, 0, t)")
        return define("\n".join(lines) + "\n", **names)["add_up"]

    # Operands and results as rows of numbers.

    def sample(self, random):
        """Operands on the domain of the record, one row per set."""
        intervals = SMOOTH_DOMAINS[self.name]
        columns, self.whole = [], []
        for position, dtype in enumerate(self.types):
            bounds = intervals[position if len(intervals) > 1 else 0]
            low, high = map(float, bounds.strip("[]").split(","))
            inside = random.uniform(0.01, 0.99, (COUNT, components(dtype)))
            values = low + (high - low) * inside
            if not is_float(dtype):
                limits = (int(low), int(high)) if len(intervals) > 1 else (1, 5)
                limits = (0, 2) if dtype is wp.bool else limits
                self.whole.append(random.integers(*limits, COUNT))
                continue
            if self.symmetric:
                values = self.symmetric(values)
            columns.append(values)
        return np.concatenate(columns, axis=1)

    def arrays(self, rows, device):
        """The operands as arrays with gradients."""
        made, start, whole = [], 0, iter(self.whole)
        for dtype in self.types:
            if not is_float(dtype):
                made.append(wp.array(next(whole), dtype=dtype, device=device))
                continue
            stop = start + components(dtype)
            made.append(self._array(rows[:, start:stop], dtype, device))
            start = stop
        return made

    @staticmethod
    def _array(values, dtype, device):
        shaped = values.reshape((COUNT, *getattr(dtype, "_shape_", ())))
        return wp.array(shaped, dtype=dtype, device=device, requires_grad=True)

    def outputs(self, device):
        return [
            wp.zeros(COUNT, dtype=dtype, device=device, requires_grad=is_float(dtype))
            for dtype in self.results
        ]

    @staticmethod
    def rows(arrays):
        """The floats of arrays, side by side."""
        return np.concatenate(
            [one.numpy().reshape(COUNT, -1) for one in arrays if one is not None], axis=1
        )

    def smooth(self, arrays):
        return [one for one in arrays if is_float(one.dtype)]

    # Evaluation.

    def run(self, rows, device):
        outputs = self.outputs(device)
        wp.launch(self.kernel, COUNT, self.arrays(rows, device), outputs, device=device)
        return self.rows(self.smooth(outputs))

    def adjoint(self, rows, weights, device):
        """The weights times the matrix of derivatives."""
        inputs, outputs = self.arrays(rows, device), self.outputs(device)
        with wp.Tape() as tape:
            wp.launch(self.kernel, COUNT, inputs, outputs, device=device)
        seeds, start = {}, 0
        for one in self.smooth(outputs):
            stop = start + components(one.dtype)
            seeds[one] = self._array(weights[:, start:stop], one.dtype, device)
            start = stop
        tape.backward(grads=seeds)
        return self.rows([one.grad for one in self.smooth(inputs)])

    def tangent(self, rows, direction, device):
        """The matrix of derivatives times the direction."""
        inputs = self.arrays(rows, device)

        def function(*operands):
            outputs = self.outputs(device)
            wp.launch(self.kernel, COUNT, list(operands), outputs, device=device)
            return self.smooth(outputs)

        along = iter(self.smooth(self.arrays(direction, device)))
        tangents = [next(along) if is_float(one.dtype) else None for one in inputs]
        return self.rows(wp.autograd.jvp(function, inputs, tangents))

    def second(self, rows, weights, direction, device):
        """The derivative of `adjoint` along a direction."""
        inputs, add_up = self.arrays(rows, device), self._define_sum()
        split_at = np.cumsum([components(t) for t in self.results if is_float(t)])[:-1]
        floats = [t for t in self.results if is_float(t)]
        factors = [
            self._array(part, dtype, device)
            for part, dtype in zip(np.split(weights, split_at, axis=1), floats)
        ]
        for one in factors:
            one.requires_grad = False

        def function(*operands):
            outputs = self.outputs(device)
            wp.launch(self.kernel, COUNT, list(operands), outputs, device=device)
            loss = wp.zeros(1, dtype=wp.float64, device=device, requires_grad=True)
            pairs = [one for pair in zip(self.smooth(outputs), factors) for one in pair]
            wp.launch(add_up, COUNT, [*pairs, loss], device=device)
            return loss

        along = iter(self.smooth(self.arrays(direction, device)))
        vectors = [next(along) if is_float(one.dtype) else None for one in inputs]
        found = wp.autograd.hvp(function, inputs, vectors)
        found = found if isinstance(found, list) else [found]
        return self.rows([one for one, v in zip(found, vectors) if v is not None])

    def differences(self, rows, device):
        """The matrix of derivatives, and for each row whether differences are to be believed."""
        coarse, fine = (self._differences(rows, device, step) for step in self.steps)
        return fine, agree(coarse, fine, self.tolerance)

    def second_differences(self, rows, weights, direction, device):
        """The result of `second`, by central differences of `adjoint`, and its reliability."""

        def along(step):
            def at(factor):
                return self.adjoint(rows + factor * step * direction, weights, device)

            return (8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * step)

        coarse, fine = map(along, self.steps)
        return fine, agree(coarse, fine, self.tolerance)

    def _differences(self, rows, device, step):
        """By central differences of fourth order."""
        columns = []
        for j in range(rows.shape[1]):
            h = np.zeros_like(rows)
            h[:, j] = step * np.maximum(1e-1, np.minimum(1.0, np.abs(rows[:, j])))

            def at(factor, h=h):
                return self.run(rows + factor * h, device)

            difference = 8 * (at(1) - at(-1)) - (at(2) - at(-2))
            columns.append(difference / (12 * h[:, j : j + 1]))
        return np.stack(columns, axis=2)
