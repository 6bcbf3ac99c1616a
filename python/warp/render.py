"""Scenes and pictures written to files.

`Scene` is a path tracer in kernels for meshes, spheres, volumes and height fields, which writes
pictures, films and pages for a browser. `UsdRenderer` writes what a simulation shows, frame by
frame, as Universal Scene Description; it needs the package `usd-core`
(`pip install warp-mlir[usd]`), which is loaded when a renderer is made. `save_picture` writes
pixels as PNG and needs nothing; other formats need Pillow, and MP4 needs imageio-ffmpeg.
"""

import typing

from warp._src.render.models import load_mesh as load_mesh
from warp._src.render.models import save_mesh as save_mesh
from warp._src.render.opengl import OpenGLRenderer as OpenGLRenderer
from warp._src.render.pictures import save_movie as save_movie
from warp._src.render.pictures import save_picture as save_picture
from warp._src.render.usd import UsdRenderer as UsdRenderer

if typing.TYPE_CHECKING:
    from warp._src.render.tracing.scene import Scene as Scene
    from warp._src.render.tracing.viewer import Viewer as Viewer


def __getattr__(name):
    # Kernels of the path tracer are declared only for those who use it.
    if name == "Scene":
        from warp._src.render.tracing.scene import Scene

        return Scene
    if name == "Viewer":
        from warp._src.render.tracing.viewer import Viewer

        return Viewer
    raise AttributeError(f"module 'warp.render' has no attribute '{name}'")
