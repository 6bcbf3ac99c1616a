"""Scenes and pictures written to files.

`UsdRenderer` writes what a simulation shows, frame by frame, as Universal Scene Description, for
viewers and renderers; it needs the package `usd-core` (`pip install warp-mlir[usd]`), which is
loaded when a renderer is made. `save_picture` writes pixels as PNG and needs nothing.
"""

from warp._src.render.opengl import OpenGLRenderer as OpenGLRenderer
from warp._src.render.pictures import save_picture as save_picture
from warp._src.render.usd import UsdRenderer as UsdRenderer
