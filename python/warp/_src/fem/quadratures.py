"""Quadratures - points and weights in the elements of a domain."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.domains import DomainRecord, domain_functions
from warp._src.fem.geometry.base import per_device
from warp._src.fem.types import coords_type


@dataclass(frozen=True)
class QuadratureRecord:
    """Facts of a quadrature that its functions of kernels depend on.

    `kind` names the maker of functions, `rule` is the rule if all elements share one, `points`
    the number of points per element if it is one for all.
    """

    kind: str
    domain: DomainRecord
    rule: object = None
    points: int | None = None
    detail: object = None

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels."""
        return quadrature_functions(self)


_MAKERS: dict = {}


@functools.cache
def quadrature_functions(record: QuadratureRecord) -> SimpleNamespace:
    """Structs and functions of kernels of a quadrature: made once per record."""
    return _MAKERS[record.kind](record, domain_functions(record.domain))


class Quadrature:
    """Base of quadratures.

    Functions of kernels take (element argument, quadrature argument, number of the element in the
    domain, number in the geometry[, point]): `point_count`, `point_coords`, `point_weight`,
    `point_index`.
    """

    record: QuadratureRecord
    rule = None

    def __init__(self, domain):
        self._domain = domain

    def __getattr__(self, name):
        if name.startswith("_") or name == "record":
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        functions = self.record.functions
        try:
            return getattr(functions, name)
        except AttributeError:
            text = f"{type(self).__name__!r} has no attribute {name!r}"
            raise AttributeError(text) from None

    @property
    def domain(self):
        """Domain of the points."""
        return self._domain

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels."""
        return self.record.functions

    @property
    def points_per_element(self) -> int | None:
        """Number of points of each element, None if it varies."""
        return self.record.points

    def max_points_per_element(self) -> int | None:
        """Largest number of points of an element, None if it is not known."""
        return self.points_per_element

    def evaluation_point_count(self) -> int:
        """Number of (element, point) pairs."""
        return self.total_point_count()

    @property
    def name(self) -> str:
        """Class and domain in one word."""
        return f"{type(self).__name__}_{self.domain.name}"

    def __str__(self) -> str:
        return self.name

    @per_device
    def arg_value(self, device):
        """Argument of the functions of points."""
        arg = self.Arg()
        self.fill_arg(arg, device)
        return arg


class RegularQuadrature(Quadrature):
    """The same points in each element.

    Args:
        domain: domain of the points.
        order: polynomials up to this degree are integrated exactly.
        family: family of the rule, None for the one with fewest points.
    """

    def __init__(self, domain, order: int, family=None):
        from warp._src.fem.cells.rules import rule

        super().__init__(domain)
        self.order, self.family = order, family
        self.rule = rule(domain.cell, order, family)
        self._key = (domain.cell.name, order, family)
        self._points = len(self.rule.weights)

    @property
    def record(self) -> QuadratureRecord:
        """Facts that functions of kernels depend on."""
        return QuadratureRecord("regular", self.domain.record, self._key, self._points)

    @property
    def name(self) -> str:
        """Class, domain, family and order in one word."""
        return f"{super().name}_{self.family}_{self.order}"

    @property
    def points(self) -> np.ndarray:
        """Coordinates of the points, (n, 3)."""
        return self.rule.points

    @property
    def weights(self) -> np.ndarray:
        """Weights of the points, (n,); their sum is 1."""
        return self.rule.weights

    def total_point_count(self) -> int:
        """Number of points in the domain."""
        return self._points * self.domain.element_count()

    def fill_arg(self, arg, device) -> None:
        """Fills an argument of the functions of points."""
        real = self.domain.geometry.scalar_type
        arg.points = wp.array(self.points, dtype=coords_type(real), device=device)
        arg.weights = wp.array(self.weights, dtype=real, device=device)


def _regular(record: QuadratureRecord, domain: SimpleNamespace) -> SimpleNamespace:
    real, n = record.domain.geometry.scalar, record.points
    ElementArg = domain.ElementArg
    fields = {"points": wp.array(dtype=coords_type(real)), "weights": wp.array(dtype=real)}
    Arg = extend.struct_from_fields("RegularArg", fields, module=__name__)

    @wp.func
    def point_count(elements: ElementArg, arg: Arg, domain_element: int, element: int):
        return n

    @wp.func
    def point_coords(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.points[k]

    @wp.func
    def point_weight(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return arg.weights[k]

    @wp.func
    def point_index(elements: ElementArg, arg: Arg, domain_element: int, element: int, k: int):
        return n * domain_element + k

    return SimpleNamespace(
        Arg=Arg,
        point_count=point_count,
        point_coords=point_coords,
        point_weight=point_weight,
        point_index=point_index,
        point_evaluation_index=point_index,
    )


_MAKERS["regular"] = _regular
