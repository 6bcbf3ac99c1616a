"""Calls of the public interface with wrong arguments: who is called, with what, and the verdict."""
