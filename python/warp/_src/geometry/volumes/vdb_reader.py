"""Read one grid of an OpenVDB file, in a process of its own that may end by a damaged file.

    python vdb_reader.py FD FILE GRID LIBRARY...

writes the bytes of a `.nvdb` file to the descriptor FD, or an error to its standard error. The last
library is the component, the others are those that it needs. An empty name is the first grid.
"""

import ctypes
import os
import resource
import sys

_LENGTH = 1024


def main(out, path, grid, *libraries):
    """Reads and writes; gives the error, or None."""
    component = [ctypes.CDLL(library) for library in libraries][-1]
    # A damaged length fails at once, instead of taking memory from others. Whole nodes of one value
    # are stored as a mask, so a grid has up to some hundred times the bytes of its file.
    with open("/proc/self/statm") as sizes:
        held = int(sizes.read().split()[0])
    pages = os.sysconf("SC_PHYS_PAGES")
    most = held * os.sysconf("SC_PAGE_SIZE") + 2**30 + 1000 * os.path.getsize(path)
    most = min(most, pages * os.sysconf("SC_PAGE_SIZE"))
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    text, size, pointer = ctypes.c_char_p, ctypes.c_size_t, ctypes.c_void_p
    component.warp_vdb_read.argtypes = [text, text, ctypes.POINTER(size), text, size]
    component.warp_vdb_read.restype = pointer
    count, error = size(), ctypes.create_string_buffer(_LENGTH)
    at = component.warp_vdb_read(
        os.fsencode(path), grid.encode(), ctypes.byref(count), error, _LENGTH
    )
    if not at:
        return error.value.decode(errors="replace")
    with open(int(out), "wb") as file:
        file.write((ctypes.c_char * count.value).from_address(at))
    return None


if __name__ == "__main__":
    problem = main(*sys.argv[1:])
    if problem is not None:
        sys.exit(problem or "unknown error")
