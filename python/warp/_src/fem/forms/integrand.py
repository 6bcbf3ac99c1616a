"""Integrands - functions of samples, fields and domains, specialised by what they are given."""

from __future__ import annotations

import typing

import warp as wp
from warp import extend
from warp._src.fem.types import Domain, Field, Sample, Sample_f64

# Samples have the scalar type of the geometry; `fem.Sample` stands for both.
AnySample = typing.TypeVar("AnySample", Sample, Sample_f64)


class Integrand(wp.Function):
    """A function that `integrate` and `interpolate` evaluate at samples.

    Attributes:
        kernel_options: options of kernels that evaluate it.
        sample_name, domain_name: parameters for the sample and the domain, or None.
        field_names: parameters for fields, in order.
        value_types: annotations of the others, by name.
    """

    # Its parameters, and the functions that it calls, say all about it.
    has_lasting_name = True

    def __init__(self, func, kernel_options=None):
        declared = extend.annotations_of(func)
        names = func.__code__.co_varnames[: func.__code__.co_argcount]
        self.sample_name = self.domain_name = None
        self.field_names, self.value_types = [], {}
        for name in names:
            kind = declared.get(name)
            if kind is Sample or kind is Sample_f64 or kind is AnySample:
                self._only("sample_name", name, func, "Sample")
            elif kind is Domain:
                self._only("domain_name", name, func, "Domain")
            elif kind is Field:
                self.field_names.append(name)
            else:
                self.value_types[name] = kind
        func.__annotations__ = {
            name: AnySample if kind is Sample or kind is Sample_f64 else kind
            for name, kind in declared.items()
        }
        # Integrands are written once for float32 and float64.
        func._wp_literals_follow_ = self.sample_name
        super().__init__(func)
        self.parameter_names = names
        self.kernel_options = dict(kernel_options or {})

    def __reduce__(self):
        # By name, as functions of Python.
        return self.__qualname__

    def _only(self, attribute, name, func, kind):
        """Sets which parameter is the sample or the domain.

        A second one is an ordinary parameter, which callers of this integrand give.
        """
        if getattr(self, attribute) is None:
            setattr(self, attribute, name)
        else:
            self.value_types[name] = func.__annotations__[name]

    @property
    def name(self) -> str:
        """Name in messages."""
        return self.key


def integrand(func=None, kernel_options=None):
    """Decorates a function that is to be integrated or interpolated.

    Parameters annotated `fem.Sample`, `fem.Domain` and `fem.Field` are given by `integrate` and
    `interpolate`; the others are values of their callers. `u(s)` is the value of a field at a
    sample, `domain(s)` its position. Integrands call each other with fields and domains.

    Args:
        func: the function.
        kernel_options: options of kernels that evaluate it.

    Example:
        >>> import warp.fem as fem
        >>> @fem.integrand
        ... def mass(s: fem.Sample, u: fem.Field, v: fem.Field):
        ...     return u(s) * v(s)
    """
    if func is None:
        return lambda function: Integrand(function, kernel_options)
    return Integrand(func, kernel_options)
