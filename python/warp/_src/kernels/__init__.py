"""Kernels and functions: translation on first use, options, launches, saved code."""
