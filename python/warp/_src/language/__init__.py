"""The kernel language at Python scope, and what of it is written in itself."""
