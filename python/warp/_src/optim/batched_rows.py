"""Shared parts of optimisers whose problems are rows of an array."""

from __future__ import annotations

import warp as wp
from warp.extend import is_array, unrecorded


class Rows:
    """An array of problems, checked.

    Raises:
        TypeError: it is not of float32 or float64.
        ValueError: it has not two dimensions, no row, no gradient, or is not contiguous.
    """

    def __init__(self, x):
        name = type(self).__name__
        if x.dtype not in (wp.float32, wp.float64):
            raise TypeError(f"{name} expects an array of float32 or float64, but got '{x.dtype}'")
        if x.ndim != 2 or x.size == 0:
            raise ValueError(f"{name} expects an array of shape (rows, columns), got {x.shape}")
        if not x.requires_grad:
            raise ValueError(f"{name}: the array has no gradient, set `requires_grad=True`")
        self.x, self.scalar, self.device = x, x.dtype, x.device

    def zeros(self, shape, dtype=None):
        """An array for the state."""
        return wp.zeros(shape, dtype=dtype or self.scalar, device=self.device)

    def check_losses(self, losses):
        """The losses of a closure, one for each row."""
        if not is_array(losses) or losses.shape != (self.x.shape[0],):
            shape = getattr(losses, "shape", type(losses).__name__)
            raise ValueError(
                f"expects a loss for each of {self.x.shape[0]} rows from the closure, but got "
                f"{shape}"
            )
        if losses.dtype != self.scalar:
            raise TypeError(f"expects losses of '{self.scalar.__name__}', but got '{losses.dtype}'")
        return losses

    def launch(self, kernel, inputs):
        """One thread for each row, unseen by tapes."""
        with unrecorded():
            wp.launch(kernel, self.x.shape[0], inputs, device=self.device)
