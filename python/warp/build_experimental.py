"""Functions and types in C++ for kernels are left out: kernels are not translated to C++."""

from warp._src import errors as _errors


def _refused(name, instead):
    raise _errors.WarpError(
        f"'wp.build_experimental.{name}' is not in this package, as kernels are not translated to "
        f"C++: {instead}"
    )


def add_builtin(*args, **options):
    """Refused; `wp.func_native` makes functions in C++.

    Raises:
        WarpError: always.
    """
    _refused("add_builtin", "declare the function with `@wp.func_native`")


def add_native_type(*args, **options):
    """Refused; `wp.struct` makes types.

    Raises:
        WarpError: always.
    """
    _refused("add_native_type", "declare the type with `@wp.struct`")


add_builtin._wp_absent_ = add_native_type._wp_absent_ = True
