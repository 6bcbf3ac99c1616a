"""The front end: Python functions become modules of the warp dialect."""
