"""Tags - annotations of an integrand's parameters that stand for fields and domains."""

from __future__ import annotations


class Field:
    """Annotation of a parameter that takes a field; base of all fields."""

    # Parameters with this annotation take records alone.
    is_open = True

    @staticmethod
    def fits(native) -> bool:
        """A value of a type of the compiler is no field."""
        return False


class Domain:
    """Annotation of a parameter that takes a domain; base of all domains."""

    is_open = True

    @staticmethod
    def fits(native) -> bool:
        """A value of a type of the compiler is no domain."""
        return False
