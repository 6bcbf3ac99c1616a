"""Types of operands and results as flat lists of numbers, and small algebra on mpmath's numbers."""

import re
from dataclasses import dataclass

import mpmath as mp

import warp as wp

#: The values of generic extents.
EXTENTS = {"n": 3, "r": 2, "c": 3, "k": 2}


@dataclass(frozen=True)
class Type:
    """A float, or a composite of floats.

    Attributes:
        kind: 'float', 'vec', 'mat', 'quat' or 'transform'.
        shape: extents; () of a float.
    """

    kind: str
    shape: tuple[int, ...] = ()

    @property
    def size(self):
        """How many numbers it has."""
        count = 1
        for extent in self.shape:
            count *= extent
        return count

    def of(self, real):
        """The type in kernels, of numbers of `real`."""
        makers = {
            "float": lambda: real,
            "vec": lambda: wp.types.vector(self.shape[0], real),
            "mat": lambda: wp.types.matrix(self.shape, real),
            "quat": lambda: wp.types.quaternion(real),
            "transform": lambda: wp.types.transformation(real),
        }
        return makers[self.kind]()

    def pack(self, numbers):
        """A number, a list of numbers, or a list of rows."""
        numbers = list(numbers)
        if self.kind == "float":
            return numbers[0]
        if self.kind == "mat":
            width = self.shape[1]
            return [numbers[i : i + width] for i in range(0, len(numbers), width)]
        return numbers


def flatten(value):
    """Numbers of a value that `pack` made, or of a tuple of such."""
    if isinstance(value, (list, tuple)):
        return [number for part in value for number in flatten(part)]
    return [value]


def parse_type(text):
    """The type that a signature names; None if it is not of floats."""
    kind, *inner = re.findall(r"[\w.]+", text)
    if kind in ("F", "G", "S", "T"):
        return Type("float")
    if kind == "quat":
        return Type("quat", (4,))
    if kind == "transform":
        return Type("transform", (7,))
    if kind in ("vec", "mat") and inner[-1] in ("F", "S"):
        shape = tuple(int(EXTENTS.get(extent, extent)) for extent in inner[:-1])
        return Type(kind, shape)
    return None


def parse_signature(text):
    """Types of operands and results of `(a: vec<n, F>, ...) -> F`; None if some are not floats."""
    if "inout" in text:
        return None
    given, _, result = text.rpartition("->")
    names = re.findall(r"(\w+): (\w+(?:<[^>]*>)?)", given)
    results = re.findall(r"\w+(?:<[^>]*>)?", result)
    operands = [parse_type(kind) for _, kind in names]
    found = [parse_type(kind) for kind in results]
    if not operands or not found or None in operands or None in found:
        return None
    return [name for name, _ in names], operands, found


def dot(a, b):
    return mp.fsum(x * y for x, y in zip(a, b, strict=True))


def norm(a):
    return mp.sqrt(dot(a, a))


def scaled(a, s):
    return [x * s for x in a]


def plus(a, b):
    return [x + y for x, y in zip(a, b, strict=True)]


def minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def cross(a, b):
    return [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]


def times(a, b):
    """Product of matrices, or of a matrix and a vector."""
    if isinstance(b[0], list):
        return [[dot(row, column) for column in zip(*b)] for row in a]
    return [dot(row, b) for row in a]


def transposed(a):
    return [list(row) for row in zip(*a)]


def quat_times(p, q):
    (ax, ay, az, aw), (bx, by, bz, bw) = p, q
    return [
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    ]


def conjugate(q):
    return [-q[0], -q[1], -q[2], q[3]]


def rotated(q, v):
    """The vector part of q v q*."""
    turned = scaled(cross(q[:3], v), mp.mpf(2))
    longer = scaled(v, mp.fsum(x * x for x in q))
    return plus(longer, plus(scaled(turned, q[3]), cross(q[:3], turned)))


def rotation(q):
    """The matrix of `rotated`."""
    columns = [rotated(q, [mp.mpf(i == j) for i in range(3)]) for j in range(3)]
    return transposed(columns)
