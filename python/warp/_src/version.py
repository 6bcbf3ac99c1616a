"""Version of the package, the folder of its files, and who calls it."""

import os
import sys

# That of the API, which clients ask for: NVIDIA Warp's, up to the second number.
VERSION = "1.19.0"
PACKAGE = os.path.dirname(os.path.dirname(__file__)) + os.sep


def calling_frame():
    """The innermost frame that is not this package's."""
    frame = sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(PACKAGE):
        frame = frame.f_back
    return frame
