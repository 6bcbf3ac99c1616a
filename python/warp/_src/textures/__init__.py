"""Textures: `texture` holds the classes, `sampling` what kernels call."""
