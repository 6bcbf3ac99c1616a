"""Devices, their memory, streams and graphs, and the start of the runtime."""
