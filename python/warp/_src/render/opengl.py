"""A stand-in for the peer's window."""

from __future__ import annotations


class OpenGLRenderer:
    """There is no window: making one is an error that says what to use."""

    def __init__(self, *args, **kwargs):
        raise NotImplementedError(
            "there is no OpenGL renderer; write a file with `warp.render.UsdRenderer`, or pixels "
            "with `warp.render.save_picture`"
        )
