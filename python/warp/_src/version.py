"""Version of the package, the folder of its files, and who calls it."""

import os
import sys

from warp._src.native import load

VERSION = load().VERSION
PACKAGE = os.path.dirname(os.path.dirname(__file__)) + os.sep


def calling_frame():
    """The innermost frame that is not this package's."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame = frame.f_back
    return frame
