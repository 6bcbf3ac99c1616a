"""State shared by the functions of one kernel while they are translated."""

from __future__ import annotations

from warp import _native
from warp._src.kernels.build_options import Build


def note_of_call(source, node) -> str:
    """The note about a call of a function, in an error within it."""
    return f"called from '{source.name}' at {source.file}:{source.line(node)}"


class Session:
    """State shared by the functions of one kernel."""

    __slots__ = (
        *("active", "build", "builder", "callers", "calls", "debug", "depends_on_threads"),
        *("derived", "handles", "unfinished"),
        *(
            "has_breakpoints",
            "is_ragged",
            "max_unroll",
            "memories",
            "parameters",
            "statics",
            "sums_winding",
            "taken",
        ),
        *("threads", "tile_builder"),
    )

    def __init__(self, builder, max_unroll=16, build=None):
        self.builder = builder
        # Options that native code is compiled with.
        self.build = build or Build()
        self.max_unroll = max_unroll
        # Keys of `calls` that are being translated.
        self.unfinished = set()
        # Finished functions by overload and argument types, and symbol names in use.
        self.calls = {}
        self.taken = {}
        # Functions whose own derivative, if they have one, has been attached.
        self.derived = set()
        # Functions being translated, outermost first, and where each but the first is called:
        # source and syntax.
        self.active = []
        self.callers = []
        # Each `wp.static` that was evaluated: function, expression, names and what it gave.
        self.statics = []
        # The kernel's arguments by name, and the kinds of those that are handles of geometry.
        self.parameters = {}
        self.handles = {}
        # True if something asks for winding numbers, of which meshes are to know.
        self.sums_winding = False
        # Threads of the blocks that the kernel is for, and what builds tiles once there is one.
        self.threads = 1
        self.depends_on_threads = False
        self.is_ragged = False
        self.tile_builder = None
        # Arrays in memory of the thread so far.
        self.memories = 0
        # Native code stops at one, and the name of a translation does not tell.
        self.has_breakpoints = False

    def next_memory(self) -> int:
        """A number for another piece of memory of the thread."""
        self.memories += 1
        return self.memories

    @property
    def tiles(self):
        """The builder of tiles; the kernel is one for blocks from here on."""
        if self.tile_builder is None:
            self.tile_builder = _native.TileBuilder(self.builder)
            self.tile_builder.set_block_threads(self.threads, self.is_ragged)
        return self.tile_builder

    def block_threads(self) -> int:
        """Threads of a block; code depends on it."""
        self.tiles  # noqa: B018
        self.depends_on_threads = True
        return self.threads

    def notes_of_calls(self) -> tuple:
        """Places that call the functions being translated, the innermost first."""
        return tuple(note_of_call(*caller) for caller in reversed(self.callers))

    def symbol(self, name: str) -> str:
        """A name for a function that no other function of the module has."""
        count = self.taken.get(name, 0)
        self.taken[name] = count + 1
        return f"{name}_{count}" if count else name
