"""Fields on grids: which nodes are inside, where edges are crossed, and what surfaces share."""

from __future__ import annotations

import abc
import typing

import numpy as np

import warp as wp
from warp._src.argument_kinds import ARRAY, INTEGER, POINT
from warp._src.arguments import checked
from warp._src.types import dtypes


@wp.func
def is_in(field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int):
    return field[i, j, k] < threshold


@wp.func
def crosses(
    field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int, axis: int
) -> bool:
    """True if the surface goes through the edge that starts at a node along an axis."""
    i1 = i + int(axis == 0)
    j1 = j + int(axis == 1)
    k1 = k + int(axis == 2)
    found = bool(False)
    if i1 < field.shape[0] and j1 < field.shape[1] and k1 < field.shape[2]:
        found = is_in(field, threshold, i, j, k) != is_in(field, threshold, i1, j1, k1)
    return found


@wp.func
def crossing(field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int, axis: int):
    """The place on an edge, from 0 to 1, at which the field has the value."""
    first = wp.float64(field[i, j, k])
    second = wp.float64(field[i + int(axis == 0), j + int(axis == 1), k + int(axis == 2)])
    # In 64 bits no difference of two floats overflows or loses digits.
    t = float((wp.float64(threshold) - first) / (second - first))
    if not (t >= 0.0 and t <= 1.0):
        t = 0.5
    return t


@wp.func
def case_of(field: wp.array3d(dtype=float), threshold: float, i: int, j: int, k: int):
    case = int(0)
    for corner in range(8):
        # Corners go around the lower face, then around the upper one.
        x = ((corner + 1) >> 1) & 1
        y = (corner >> 1) & 1
        z = corner >> 2
        case += int(is_in(field, threshold, i + x, j + y, k + z)) << corner
    return case


def check_field(field):
    if not dtypes.is_array(field) or len(field.shape) != 3:
        raise ValueError(
            f"expects a 3D array as 'field', but got one of shape {getattr(field, 'shape', None)}"
        )
    if min(field.shape) < 2:
        raise ValueError(
            f"'field' has at least 2 nodes on each axis, but its shape is {field.shape}"
        )
    if field.dtype is not dtypes.float32:
        raise TypeError(f"expects a 'field' of float32, but got {dtypes.type_repr(field.dtype)}")


def _total(ends) -> int:
    return int(ends.flatten()[-1:].numpy()[0])


def scan(counts):
    """Sums up to and with each element; waits for the last one."""
    flat = counts.flatten()
    wp.utils.array_scan(flat, flat, inclusive=True)
    return _total(counts)


def plain(values):
    """An array without gradients over the memory of another one."""
    return wp.array(
        ptr=values.ptr or 0,
        dtype=values.dtype,
        shape=values.shape,
        strides=values.strides,
        device=values.device,
    )


@wp.kernel(enable_backward=False, module="unique")
def count_of_cases(
    field: wp.array3d(dtype=float),
    threshold: float,
    starts: wp.array(dtype=int),
    counts: wp.array3d(dtype=int),
):
    """How much the table `starts` has for the case of each cell."""
    i, j, k = wp.tid()
    case = case_of(field, threshold, i, j, k)
    counts[i, j, k] = starts[case + 1] - starts[case]


class Sampled:
    """A field that has been checked, and where its nodes are.

    Attributes:
        field, threshold, shape, device: what was given.
        plain: the field without gradients, as what is counted has no derivative.
        lower, spacing: the place of the first node, and from one to the next.
    """

    def __init__(self, field, threshold, lower, upper):
        """Checks the field.

        Raises:
            ValueError: it has other than three dimensions, or fewer than two nodes along one.
            TypeError: it is not of float32.
        """
        check_field(field)
        self.field, self.device, self.shape = field, field.device, tuple(field.shape)
        self.threshold = float(getattr(threshold, "value", threshold))
        shape = np.array(self.shape)
        low = np.zeros(3) if lower is None else np.array(list(lower), dtype=np.float64)
        high = shape - 1.0 if upper is None else np.array(list(upper), dtype=np.float64)
        self.lower, self.spacing = wp.vec3(*low), wp.vec3(*((high - low) / (shape - 1)))
        self.plain = plain(field)

    def launch(self, kernel, dim, *inputs):
        """Launches a kernel that counts or lists."""
        given = [self.plain, self.threshold, *inputs]
        wp.launch(kernel, dim, inputs=given, device=self.device)

    def place(self, kernel, count, *inputs):
        """Launches a kernel that finds vertices, which follow the field; gives them."""
        wanted = self.field.requires_grad
        vertices = wp.empty(count, dtype=wp.vec3, device=self.device, requires_grad=wanted)
        given = [self.field, self.threshold, self.lower, self.spacing, *inputs, vertices]
        wp.launch(kernel, count, inputs=given, device=self.device)
        return vertices


class IsoSurfaceBase(abc.ABC):
    """Surfaces in fields of one shape; a subclass has `extract`.

    Args:
        nx, ny, nz: nodes of the grid.
        lower, upper: where its first and its last node are; by default at their indices.

    Attributes:
        verts: vertices, an array of vec3, of the last `surface`.
        indices: vertices of each face, one face after the other. Seen from larger values they go
            counter-clockwise.
    """

    @checked(nx=INTEGER, ny=INTEGER, nz=INTEGER, lower=POINT, upper=POINT)
    def __init__(self, nx, ny, nz, *, lower=None, upper=None):
        self.nx, self.ny, self.nz = nx, ny, nz
        self.lower, self.upper = lower, upper
        self.verts: typing.Any = None
        self.indices: typing.Any = None

    @classmethod
    @abc.abstractmethod
    def extract(cls, field, threshold=0.0, *, lower=None, upper=None):
        """Vertices and indices of the surface where a field crosses a value."""

    @checked(nx=INTEGER, ny=INTEGER, nz=INTEGER)
    def resize(self, nx, ny, nz) -> None:
        """Takes fields of another shape from now on."""
        self.nx, self.ny, self.nz = nx, ny, nz

    def _options(self) -> dict:
        """Options of `extract` beside the bounds."""
        return {}

    @checked(field=ARRAY)
    def surface(self, field, threshold) -> None:
        """Finds the surface of a field, as `verts` and `indices`.

        Raises:
            ValueError: the field is of another shape than this object.
        """
        if tuple(field.shape) != (self.nx, self.ny, self.nz):
            raise ValueError(
                f"the field has the shape {tuple(field.shape)}, but expected "
                f"{(self.nx, self.ny, self.nz)}"
            )
        self.verts, self.indices = self.extract(
            field, threshold, lower=self.lower, upper=self.upper, **self._options()
        )
