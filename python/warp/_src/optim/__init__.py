"""Implementation of `warp.optim`."""
