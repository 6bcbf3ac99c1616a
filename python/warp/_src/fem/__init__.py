"""Implementation of `warp.fem`."""
