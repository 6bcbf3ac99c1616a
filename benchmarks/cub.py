"""Calls of the functions in cub.cu."""

import ctypes

import warp as wp


class Cub:
    """The library made of cub.cu."""

    def __init__(self, path):
        self.library = ctypes.CDLL(path)

    def case(self, name, *arguments):
        """A call of a function with arrays and counts, its temporary memory at hand."""
        function = getattr(self.library, name)
        device = next(a.device for a in arguments if isinstance(a, wp.array))
        given = [
            ctypes.c_void_p(a.ptr) if isinstance(a, wp.array) else ctypes.c_int(a)
            for a in arguments
        ]
        size = ctypes.c_size_t(0)

        def call(temporary):
            error = function(temporary, ctypes.byref(size), *given)
            if error:
                raise RuntimeError(f"{name}: CUDA error {error}")

        call(None)
        memory = wp.empty(max(1, size.value), dtype=wp.uint8, device=device)
        pointer = ctypes.c_void_p(memory.ptr)
        # The arrays live as long as the call.
        return lambda keep=(memory, arguments): call(pointer)
