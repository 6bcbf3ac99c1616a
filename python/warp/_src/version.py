"""Version of the package, and the folder that its files are in."""

import os

VERSION = "0.1.0"
PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep
