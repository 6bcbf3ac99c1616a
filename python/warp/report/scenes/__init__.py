"""Scenes that come with the package; each file registers a few and is also an example."""
