"""The lasting name of a kernel, by which other processes find it.

The name is a hash of all that a translation may read: the text of the function and of those that it
may call, what their words mean (captured variables, globals, attributes of modules and classes),
annotations, defaults, the types of generic arguments, this package and Python. It is found without
parsing anything: every word of a text counts as a name, so that the hash depends on more than the
translation does, never on less.

A text may mention values that have no name that lasts (`names`) in a comment, or in `wp.static`,
whose values are compared apart (`statics`); a kernel that uses one elsewhere is translated in every
process, as is one with native code. A function that was made from text or by code transformers has
the text that they made (`made_functions`).
"""

from __future__ import annotations

import functools
import os
import re
import sys
from _blake2 import blake2b

from warp import _native, config
from warp._src.kernels import texts
from warp._src.kernels.function import Function
from warp._src.kernels.names import Names, UnnamedError, is_plain
from warp._src.version import VERSION

# Functions of these names extend operators to structs, without being named in a text.
OPERATORS = (
    *("add", "sub", "mul", "div", "floordiv", "mod", "pow", "lshift", "rshift", "bit_and"),
    *("bit_or", "bit_xor", "lt", "le", "gt", "ge", "eq", "ne", "neg", "pos", "invert", "unot"),
)
_WORD = re.compile(r"[^\W\d]\w*")


@functools.cache
def _installation() -> str:
    """Sizes and times of this package's files, as Python looks at them before it loads them."""
    found = []

    def visit(folder, path):
        with os.scandir(folder) as entries:
            for entry in sorted(entries, key=lambda one: one.name):
                if entry.name.endswith(".py"):
                    state = entry.stat()
                    found.append((path, entry.name, state.st_mtime_ns, state.st_size))
                elif entry.name != "__pycache__" and entry.is_dir():
                    visit(entry.path, f"{path}/{entry.name}")

    visit(os.path.dirname(_native.__file__), "")
    about = repr((VERSION, _native.build_id(), sys.hexversion, found))
    return blake2b(about.encode("utf-8", "surrogatepass"), digest_size=32).hexdigest()


class Identity(Names):
    """The facts about one kernel, or value.

    Attributes:
        functions: the Python functions that may be translated, in a fixed order.
        unnamed: for each function, the words in it that mean something without a name that lasts.
        unnamed_attributes: the same of attributes, of whatever.
    """

    def __init__(self, threads=None):
        super().__init__(threads)
        self.functions: list = []
        self.unnamed: list[set] = []
        self.unnamed_attributes: set = set()
        self._visited = 0
        self._words: set = set()

    def digest(self) -> str:
        """64 hexadecimal digits.

        Raises:
            UnnamedError: something that counts has no name.
        """
        self._settle()
        made = blake2b(digest_size=32)
        for part in self._parts:
            made.update(part.encode("utf-8", "surrogatepass"))
            made.update(b"\0")
        return made.hexdigest()

    def add(self, value) -> None:
        """Makes a value count."""
        self._parts.append(self.token(value))

    # The search.

    def _settle(self) -> None:
        """Visits functions, and looks for words in modules and classes, until nothing is new."""
        seen = -1
        while seen != len(self._parts):
            seen = len(self._parts)
            while self._visited < len(self.functions):
                self._visited += 1
                self._visit(self._visited - 1)
            for owner in self._owners:
                for word, value in owner.found(self._words):
                    self._note(f".{word}", value, self.unnamed_attributes)

    def function(self, function) -> str:
        """A Python function that may be translated."""
        number, is_new = self._number(function)
        if is_new:
            self.functions.append(function)
            self.unnamed.append(set())
        return f"f{number}"

    def _visit(self, index) -> None:
        function, unnamed = self.functions[index], self.unnamed[index]
        code = function.__code__
        try:
            block = texts.block_of(function)
        except Exception:
            raise UnnamedError from None
        place = function.__module__, function.__qualname__, function.__name__
        if block.identity is None or block.identity[0] != place:
            file = os.fsencode(code.co_filename)
            facts = place, file, code.co_firstlineno, code.co_varnames, block.text
            block.identity = place, repr(facts)
        self._parts.append(block.identity[1])
        self._parts.append(self.token(function.__defaults__))
        self._parts.append(self.token(function.__kwdefaults__))
        words = block.words
        for name, annotation in function.__annotations__.items():
            if isinstance(annotation, str):
                words = words.union(_WORD.findall(annotation))
            self._parts.append(f"{name}: {self.token(annotation)}")
        self._words |= words
        captured = dict(zip(code.co_freevars, function.__closure__ or (), strict=True))
        space = function.__globals__
        for word in sorted((words & captured.keys()) | (words & space.keys())):
            try:
                cell = captured.get(word)
                self._note(word, cell.cell_contents if cell else space[word], unnamed)
            except ValueError:
                self._parts.append(f"{word} empty")
        # Where a text has its own variable of a name, it never means anything else by it.
        unnamed -= {
            word
            for word in unnamed & set(code.co_varnames)
            if not isinstance(captured.get(word, space.get(word)), Function)
        }
        for word in OPERATORS:
            if isinstance(space.get(word), Function):
                self._note(word, space[word], unnamed)

    def _note(self, word, value, unnamed) -> None:
        try:
            self._parts.append(f"{word}={self.token(value)}")
        except Exception:
            # Whatever goes wrong in looking at an object of somebody else's.
            self._parts.append(f"{word}=?")
            unnamed.add(word.removeprefix("."))


def of_value(value) -> tuple:
    """The lasting name of a value, or None; and the functions that it belongs to."""
    if is_plain(value):
        return f"{type(value).__name__} {value!r}", ()
    found = Identity()
    try:
        found.add(value)
        return found.digest(), found.functions
    except Exception:
        return None, ()


def name_of(kernel, arguments=None, threads=1, constants=None):
    """The name of a kernel's translation, and the `Identity` behind it.

    Args:
        arguments, threads, constants: as for `translate_kernel`.

    Raises:
        UnnamedError: there is none.
    """
    found = Identity(threads)
    types_of_arguments = None if arguments is None else tuple(map(str, arguments))
    budgets = kernel.option("max_unroll"), kernel.option("inline_budget")
    given = (kernel.key, budgets, types_of_arguments, threads)
    found._parts.append(_installation())
    settings = config.legacy_scalar_return_types, config.peer_tile_gradients
    found._parts.append(repr((given, settings)))
    for path, constant in (constants or {}).items():
        found._parts.append(f"{path}: {found.token(constant)}")
    found.function(kernel.func)
    return found.digest(), found
