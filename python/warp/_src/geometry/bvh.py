"""`Bvh`: a bounding volume hierarchy over boxes."""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import ARRAY, INTEGER, TEXT
from warp._src.arguments import checked
from warp._src.devices import devices
from warp._src.types import dtypes
from warp._src.types.scalars import int32

# As the runtime numbers them; the last is for what kernels build.
_SAH, _MEDIAN, _NONE = 0, 1, 2
# There is one kind of hierarchy: that of another library is a name for it.
_CONSTRUCTORS = {None: _SAH, "sah": _SAH, "cubql": _SAH, "lbvh": _MEDIAN, "median": _MEDIAN}


def constructor_number(constructor, on_device=False) -> int:
    """The runtime's method for a constructor of that name.

    Raises:
        ValueError: there is no such constructor.
    """
    if constructor not in _CONSTRUCTORS:
        raise ValueError(
            f"expects the constructor 'sah', 'median', 'lbvh' or 'cubql', but got {constructor!r}"
        )
    return _NONE if on_device else _CONSTRUCTORS[constructor]


def builds_on_device(device, constructor) -> bool:
    """True if kernels build a hierarchy, and not the host."""
    return not device.is_cpu and constructor != "sah"


def is_cubql_available() -> bool:
    """False: hierarchies are always those of this package."""
    return False


def check_leaf_size(leaf_size) -> None:
    """Leaves hold up to eight primitives whatever was asked for.

    Raises:
        ValueError: the size is not positive.
    """
    if leaf_size < 1:
        raise ValueError(f"expects a leaf size of at least 1, but got {leaf_size}")


def check_array(values, what, dtype, device=None) -> None:
    """Checks an array that geometry is made of.

    Raises:
        RuntimeError: it is none, or of another type, rank, layout or device.
    """
    if not dtypes.is_array(values) or not dtypes.types_equal(values.dtype, dtype):
        shown = dtypes.type_repr(values.dtype if dtypes.is_array(values) else type(values))
        raise errors.WarpError(f"{what} are an array of {dtype.__name__}, but got {shown}")
    if values.ndim != 1 or not values.is_contiguous:
        raise errors.WarpError(f"{what} are a packed array of one dimension")
    if device is not None and values.device != device:
        raise errors.WarpError(f"{what} are on '{values.device}', but expected on '{device}'")


def check_groups(groups, like) -> None:
    """Checks the array of groups of primitives, or None.

    Raises:
        RuntimeError: it is of another type, rank, layout or device.
    """
    if groups is not None:
        check_array(groups, "groups", int32, like.device)


def check_group_count(groups, count, what, primitives) -> None:
    """Checks that each primitive has a group, if any has.

    Raises:
        RuntimeError: there are more or less.
    """
    if groups is not None and len(groups) != count:
        raise errors.WarpError(
            f"{what} with groups has one for each of its {count} {primitives}, "
            f"but got {len(groups)}"
        )


class Hierarchical:
    """Common parts of a `Bvh` and a `Mesh`: a place, groups of primitives."""

    @property
    def device(self):
        """The device of the arrays and of the hierarchy."""
        return self._device

    @property
    def groups(self):
        """A number for each primitive, or None; `rebuild` takes over another array."""
        return self._groups

    @groups.setter
    def groups(self, groups):
        check_groups(groups, self)
        self._groups = groups

    def _wait(self):
        """The host reads the arrays: what writes them has to be done."""
        if not self._device.is_cpu:
            devices.synchronize_device(self._device)


class Bvh(Hierarchical):
    """A hierarchy over boxes, which kernels search by its `id`.

    Args:
        lowers, uppers: arrays of vec3 with the corners of the boxes, which are kept.
        constructor: "sah" (surface area heuristic), "median" (halves) or "lbvh". By default "sah"
            on a CPU and "median" on a GPU, where kernels build it and "lbvh", which all with groups
            are, is quicker to build and slower to search; as "sah" the host builds for a GPU, too.
        groups: array of int32, a number for each box; `bvh_get_group_root` gives where to start
            a query of the boxes of one number.
        leaf_size: changes nothing; leaves hold up to eight boxes.

    Attributes:
        id: what kernels get, as `wp.uint64`.
        report: nodes, blocks, bytes and depth of the hierarchy, and how many boxes were NaN or
            inverted when it was built (by the host: or refitted). Nothing finds those until a
            refit when they are proper. Boxes may be infinite.

    Raises:
        RuntimeError: an array is of another type, length, layout or device.
        ValueError: there is no such constructor, or the leaf size is not positive.

    Example:
        >>> import warp as wp
        >>> lowers = wp.array([[0.0, 0.0, 0.0]], dtype=wp.vec3, device="cpu")
        >>> uppers = wp.array([[1.0, 1.0, 1.0]], dtype=wp.vec3, device="cpu")
        >>> wp.Bvh(lowers, uppers).report.skipped
        0
    """

    @checked(lowers=ARRAY, uppers=ARRAY, constructor=TEXT, groups=ARRAY, leaf_size=INTEGER)
    def __init__(self, lowers, uppers, constructor=None, groups=None, leaf_size=1):
        check_array(lowers, "lower corners", dtypes.vec3f)
        check_array(uppers, "upper corners", dtypes.vec3f, lowers.device)
        check_leaf_size(leaf_size)
        there = builds_on_device(lowers.device, constructor)
        number = constructor_number(constructor, there)
        check_groups(groups, lowers)
        self._device, self._count = lowers.device, len(lowers)
        self._lowers, self._uppers, self._groups = lowers, uppers, groups
        self._constructor = constructor
        self._check_corners()
        check_group_count(groups, self._count, "a Bvh", "boxes")
        # Refits of hierarchies that the host has built for a GPU, and builds there.
        self._kernels = self._built = None
        if not there:
            self._wait()
        index = devices.resolve_index(self.device)
        self._native = _native.Bvh(lowers, uppers, groups, index, number)
        self.id = self._native.id
        if there:
            self._build(constructor)
            self._built.finish()
        else:
            self._prepare_refits()

    def __reduce__(self):
        return type(self), (self.lowers, self.uppers, self._constructor, self.groups)

    @property
    def lowers(self):
        """Lower corners of the boxes; `refit` and `rebuild` take over another array."""
        return self._lowers

    @lowers.setter
    def lowers(self, lowers):
        check_array(lowers, "lower corners", dtypes.vec3f, self._device)
        self._lowers = lowers

    @property
    def uppers(self):
        """Upper corners of the boxes; `refit` and `rebuild` take over another array."""
        return self._uppers

    @uppers.setter
    def uppers(self, uppers):
        check_array(uppers, "upper corners", dtypes.vec3f, self._device)
        self._uppers = uppers

    @property
    def report(self):
        """The primitives of the hierarchy."""
        return (self._built or self._native).report

    def _check_corners(self):
        lowers, uppers = len(self.lowers), len(self.uppers)
        if lowers != uppers:
            raise errors.WarpError(
                f"a Bvh needs as many lower corners as upper ones, but got {lowers} and {uppers}"
            )

    def refit(self):
        """Takes over boxes that moved; neighbours in the hierarchy stay neighbours.

        On a GPU kernels do it, which graphs may capture.

        Raises:
            RuntimeError: there are not as many boxes as when it was built.
        """
        self._check_corners()
        if len(self.lowers) != self._count:
            raise errors.WarpError(
                f"a refitted Bvh keeps its {self._count} boxes, but got {len(self.lowers)}; "
                "`rebuild` takes more or less"
            )
        (self._built or self._kernels or self._native).refit(self.lowers, self.uppers)

    @checked(constructor=TEXT)
    def rebuild(self, constructor=None):
        """Builds the hierarchy again, for boxes that moved far.

        Where kernels do it, a graph captures it once it was done outside.

        Raises:
            RuntimeError: there are more corners of one kind than of the other, or more or less
                groups than boxes.
            ValueError: there is no such constructor.
        """
        self._check_corners()
        check_group_count(self.groups, len(self.lowers), "a Bvh", "boxes")
        constructor = self._constructor if constructor is None else constructor
        there = builds_on_device(self.device, constructor)
        number = constructor_number(constructor, there)
        self._count = len(self.lowers)
        if there:
            self._build(constructor)
            return
        self._wait()
        self._native.rebuild(self.lowers, self.uppers, self.groups, number)
        self._built = None
        self._prepare_refits()

    def _prepare_refits(self):
        """After a build by the host: for a GPU, kernels refit, which a graph may record."""
        if not self.device.is_cpu:
            from warp._src.geometry.device.refit import refit_of

            self._kernels = refit_of(self, of_triangles=False)

    def _build(self, constructor):
        """Builds on the device."""
        from warp._src.geometry.device.build import build_of

        built = build_of(self._built, constructor, self.lowers, self.uppers, self.groups, False)
        if built is not self._built:
            if self._built or self._kernels:
                # Kernels that run may read the slot.
                self._wait()
            self._native.adopt(*built.memory)
            self._built, self._kernels = built, None
        self._built.run(self.id, self.lowers, self.uppers)
