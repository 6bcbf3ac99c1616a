"""Descriptions and operators: types that libraries make known to the kernel language."""

from __future__ import annotations


class Description:
    """The compile-time part of a record: subclasses are frozen dataclasses of plain values.

    Called in a kernel with the record's parts, it gives a record. Two descriptions that are equal
    have one translation, and the kernel cache knows them by the values of their fields.

    Example:
        >>> import dataclasses
        >>> import warp as wp
        >>> from warp import extend
        >>> @wp.func
        ... def line_value(slope: float, x: float):
        ...     return slope * x
        >>> @dataclasses.dataclass(frozen=True)
        ... class Line(extend.Description):
        ...     degree: int = 1
        ...
        ...     def operation(self, name, count):
        ...         return {"()": line_value, "degree": extend.Static(self.degree)}.get(name)
        >>> Line().operation("degree", 0).value
        1
    """

    def operation(self, name: str, count: int):
        """The meaning of an operator applied to a record.

        Args:
            name: of the operator; "()" for a call of the record.
            count: arguments after the record.

        Returns:
            A `wp.Function`, called with the parts and the arguments; an `OnField`, a `Static`, a
            `Recast`; None if the operator is not defined.

        Raises:
            TypeError, ValueError: the operator cannot be applied; says why.
        """
        return None

    def __str__(self):
        return type(self).__name__


class Operator:
    """A name that kernels call with a record first, as in `grad(u, s)`.

    Example:
        >>> from warp import extend
        >>> extend.Operator("grad")
        <operator 'grad'>
    """

    def __init__(self, name, doc=None):
        self.name = name
        self.__doc__ = doc

    def __call__(self, *args, **kwargs):
        raise TypeError(f"'{self.name}' can be called in kernels only")

    def __repr__(self):
        return f"<operator '{self.name}'>"


class Static:
    """Result of `Description.operation`: a value known at compile time.

    Example:
        >>> from warp import extend
        >>> extend.Static(3).value
        3
    """

    __slots__ = ("value",)

    def __init__(self, value):
        self.value = value


class Recast:
    """Result of `Description.operation`: a record of another description.

    function: makes the new record's part, or a tuple of its parts, of the old one's; None keeps
        them.

    Example:
        >>> from warp import extend
        >>> class Sum(extend.Description):
        ...     def operation(self, name, count):
        ...         return extend.Recast(self) if name == "copy" else None
        >>> Sum().operation("copy", 0).function is None
        True
    """

    __slots__ = ("description", "function")

    def __init__(self, description, function=None):
        self.description = description
        self.function = function


class OnField:
    """Result of `Description.operation`: a function of one field of the record's only part.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> @wp.func
        ... def square(x: float):
        ...     return x * x
        >>> extend.OnField(square, "radius").field
        'radius'
    """

    __slots__ = ("field", "function")

    def __init__(self, function, field):
        self.function = function
        self.field = field
