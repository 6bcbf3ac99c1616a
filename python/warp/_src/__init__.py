"""Implementation of the package, by topic."""
