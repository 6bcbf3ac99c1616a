"""Settings of the package; `dir(wp.config)` lists them."""

from warp._src.config import install
from warp._src.version import VERSION

install(__name__, VERSION)
