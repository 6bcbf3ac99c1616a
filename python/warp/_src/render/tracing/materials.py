"""Materials as kernels read them, checked."""

import numpy as np

from warp._src.render.tracing.records import Material

_COLORS = ("color", "emission", "absorption")
_SHARES = ("roughness", "metallic", "specular", "transmission")


def material_row(given):
    """The record of a material without a texture."""
    row = np.zeros(1, Material.numpy_dtype())
    for name in _COLORS:
        values = np.asarray(given[name], np.float32)
        if values.shape != (3,) or not (np.isfinite(values) & (values >= 0.0)).all():
            raise ValueError(
                f"expects '{name}' as three numbers of 0 or more, but got {given[name]}"
            )
        row[name] = values
    for name in _SHARES:
        if not 0.0 <= given[name] <= 1.0:
            raise ValueError(f"expects '{name}' from 0 to 1, but got {given[name]}")
        row[name] = given[name]
    if not given["ior"] > 0.0:
        raise ValueError(f"expects a positive 'ior', but got {given['ior']}")
    row["ior"], row["checker"], row["texture"] = given["ior"], given["checker"], -1
    return row


def texels_of(texture):
    """A texture's colours as float32."""
    rows = texture.numpy() if hasattr(texture, "numpy") else np.asarray(texture)
    if rows.ndim != 3 or rows.shape[2] != 3 or rows.size == 0:
        raise ValueError(f"expects a texture of shape (rows, columns, 3), but got {rows.shape}")
    if rows.dtype.kind != "f":
        raise TypeError(f"expects a texture of floats, but got '{rows.dtype}'")
    return np.ascontiguousarray(rows, np.float32)
