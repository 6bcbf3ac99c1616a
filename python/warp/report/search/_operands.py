"""Operands that bring out what formulas get wrong."""

import numpy as np


def _quat(random, count, spread):
    """Unit quaternions; `spread` scales the vector part, 0 is the identity."""
    q = random.normal(size=(count, 4))
    q[:, :3] *= spread
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _plain(random, count, kind):
    if kind.kind == "quat":
        return _quat(random, count, 1.0)
    values = random.normal(size=(count, kind.size))
    if kind.kind == "transform":
        values[:, 3:] = _quat(random, count, 1.0)
    return values


def _near(random, count, kind):
    """Near what is special: 1, the identity, equal components, rank one, multiples of pi / 2."""
    tiny = 10.0 ** random.uniform(-9, -1, size=(count, 1))
    noise = tiny * random.normal(size=(count, kind.size))
    if kind.kind in ("quat", "transform"):
        values = noise
        values[:, -4:] = _quat(random, count, tiny)
        return values
    if kind.kind == "mat":
        rows, columns = kind.shape
        identity = np.eye(rows, columns).reshape(1, -1)
        one = np.einsum(
            "ni,nj->nij", random.normal(size=(count, rows)), random.normal(size=(count, columns))
        ).reshape(count, -1)
        return np.where(np.arange(count)[:, None] % 2, identity, one) + noise
    if kind.kind == "vec":
        axis = np.eye(kind.size)[random.integers(kind.size, size=count)]
        return np.where(np.arange(count)[:, None] % 2, axis, 1.0) + noise
    special = np.array([0.0, 1.0, -1.0, 0.5, np.pi / 2, np.pi, 2 * np.pi, 8.0])
    return special[random.integers(special.size, size=count)][:, None] + noise


def _mixed(random, count, kind):
    """Components of very different size."""
    size = 10.0 ** random.uniform(-6, 6, size=(count, kind.size))
    values = _plain(random, count, kind) * size
    if kind.kind in ("quat", "transform"):
        values[:, -4:] /= np.linalg.norm(values[:, -4:], axis=1, keepdims=True)
    return values


def _rows(make):
    def strategy(random, count, kinds, tiny):
        return [make(random, count, kind) for kind in kinds]

    return strategy


def _alike(random, count, kinds, tiny):
    """Operands of one type are nearly equal or opposite."""
    found, first = [], {}
    for kind in kinds:
        if kind not in first:
            first[kind] = _plain(random, count, kind)
            found.append(first[kind])
            continue
        near = 10.0 ** random.uniform(-9, -1, size=(count, 1))
        sign = np.where(random.integers(2, size=(count, 1)), 1.0, -1.0)
        found.append(sign * (first[kind] + near * random.normal(size=(count, kind.size))))
        if kind.kind in ("quat", "transform"):
            found[-1][:, -4:] /= np.linalg.norm(found[-1][:, -4:], axis=1, keepdims=True)
    return found


def _long(random, count, kinds, tiny):
    """Quaternions that are not of unit length."""
    values = [_plain(random, count, kind) for kind in kinds]
    for value, kind in zip(values, kinds, strict=True):
        if kind.kind in ("quat", "transform"):
            value[:, -4:] *= 10.0 ** random.uniform(-2, 2, size=(count, 1))
    return values


def _at(power):
    """All operands near one power of ten, the same for floats and doubles in relation."""

    def strategy(random, count, kinds, tiny):
        scale = 10.0 ** (power * (1.0 if tiny > 1e-100 else 8.4))
        values = [_plain(random, count, kind) for kind in kinds]
        return [
            value if kind.kind in ("quat", "transform") else value * scale
            for value, kind in zip(values, kinds, strict=True)
        ]

    return strategy


def _subnormal(random, count, kinds, tiny):
    values = [_plain(random, count, kind) for kind in kinds]
    return [
        value if kind.kind in ("quat", "transform") else value * tiny * 0.1
        for value, kind in zip(values, kinds, strict=True)
    ]


def _special(random, count, kind):
    """Operands that formulas divide by zero for: identity, zero, repeated values, along axes."""
    half = 0.5**0.5
    zeros = np.zeros(kind.size)
    if kind.kind in ("quat", "transform"):
        turns = [[0, 0, 0, 1], [1, 0, 0, 0], [half, 0, 0, half], [0.5, 0.5, 0.5, 0.5]]
        choices = [np.concatenate([zeros[4:], turn]) for turn in turns]
    elif kind.kind == "mat":
        scales = np.arange(1, min(kind.shape) + 1) // 2 + 1.0
        parts = [np.eye(*kind.shape), np.ones(kind.shape), 0 * np.eye(*kind.shape)]
        for order in (scales, scales[::-1]):
            parts.append(np.eye(*kind.shape))
            np.fill_diagonal(parts[-1], order)
        choices = [part.ravel() for part in parts]
    elif kind.kind == "vec":
        choices = [zeros, zeros + 1, *np.eye(kind.size), *-np.eye(kind.size)]
    else:
        choices = [zeros + x for x in (0.0, 1.0, -1.0, 0.5, 2.0)]
    return np.array(choices)[random.integers(len(choices), size=count)]


LONG = "not of unit length"
SPECIAL = "special"
STRATEGIES = {
    "plain": _rows(_plain),
    "near": _rows(_near),
    "mixed": _rows(_mixed),
    "alike": _alike,
    LONG: _long,
    "1e-19": _at(-19),
    "1e+19": _at(19),
    "subnormal": _subnormal,
    SPECIAL: _rows(_special),
}


def operands(random, count, kinds, dtype, strategies):
    """(strategy, arrays) with a row of numbers for each of `count` operands, rounded to `dtype`."""
    tiny = float(np.finfo(dtype).tiny)
    for name, strategy in strategies.items():
        yield name, [value.astype(dtype) for value in strategy(random, count, kinds, tiny)]
