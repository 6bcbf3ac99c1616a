"""Finite elements are left out: the names can be imported and annotated with, not used."""

from warp._src.absent import absent_class as _absent_class

_made: dict = {}


def integrand(function=None, **options):
    """Stands for the peer's decorator; what it decorates cannot be integrated here."""
    if function is None:
        return integrand
    return _made.setdefault(function, _absent_class(function.__name__, "fem"))


integrand._wp_absent_ = True


def __getattr__(name):
    if name.startswith("_"):
        raise AttributeError(f"module 'warp.fem' has no attribute '{name}'")
    return _made.setdefault(name, _absent_class(name, "fem"))
