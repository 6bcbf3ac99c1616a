"""Axes of meshes that arrays vary over in `jax.shard_map`, in the terms of old and new JAX.

JAX knows of each array over which axes its contents differ from device to device, and does not look
into calls of native functions. A result varies over each axis that any input varies over. JAX up to
0.9 calls these axes `vma`, later ones keep them in a `manual_axis_type`; before 0.6 there are none.
"""

from __future__ import annotations

import functools
import inspect


def varying(jax, buffers) -> frozenset:
    """The axes of meshes that any of the arrays varies over."""
    return frozenset().union(*(_axes_of(_type_of(jax, one)) for one in buffers))


def _type_of(jax, value):
    return jax.typeof(value) if hasattr(jax, "typeof") else None


def _axes_of(kind) -> frozenset:
    manual = getattr(kind, "manual_axis_type", None)
    found = getattr(kind, "vma", None) if manual is None else manual.varying
    return frozenset(found or ())


def vary_alike(jax, buffers) -> list:
    """The arrays, each varying over the axes that any of them varies over.

    JAX wants this of the inputs of one call. It sums derivatives over the axes that were added.
    """
    axes = varying(jax, buffers)
    return [_vary(jax, one, axes - _axes_of(_type_of(jax, one))) for one in buffers]


def _vary(jax, value, axes):
    if not axes:
        return value
    names = tuple(sorted(axes, key=str))
    if hasattr(jax.lax, "pcast"):
        return jax.lax.pcast(value, names, to="varying")
    return jax.lax.pvary(value, names)


@functools.cache
def _describes_axes(jax) -> bool:
    """True if the type of a result can say over which axes it varies; in JAX 0.6.0 it cannot."""
    known = inspect.signature(jax.ShapeDtypeStruct).parameters
    return "vma" in known or "manual_axis_type" in known


def describe(jax, shape, dtype, like):
    """The shape and type of a call's result for JAX.

    Args:
        like: the inputs of the call.
    """
    axes = varying(jax, like)
    if not axes or not _describes_axes(jax):
        return jax.ShapeDtypeStruct(shape, dtype)
    manual = getattr(_type_of(jax, like[0]), "manual_axis_type", None)
    options = {"vma": axes} if manual is None else {"manual_axis_type": type(manual)(varying=axes)}
    # The axes belong to the mesh that is in force, which the type of the result has to name.
    if hasattr(jax.sharding, "get_abstract_mesh"):
        mesh = jax.sharding.get_abstract_mesh()
        options["sharding"] = jax.sharding.NamedSharding(mesh, jax.sharding.PartitionSpec())
    return jax.ShapeDtypeStruct(shape, dtype, **options)
