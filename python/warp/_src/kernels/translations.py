"""Native kernels from translations that an earlier process has left in the kernel cache.

To translate a function takes many times longer than to load its code. So the result is kept under a
name that is found without it (`identity`): what launches need to know, and the text of the module
for whatever asks for more later. The front end's remarks to the kernel on the way are in the notes.
"""

from __future__ import annotations

import gc
import marshal
from _blake2 import blake2b

from warp import _native, config
from warp._src import errors
from warp._src.kernels import identity, statics, texts

# Translations of one kernel that are looked at, for other values of its static expressions.
_MOST_STATICS = 8


def native_kernel(kernel, arguments, threads, constants):
    """The native kernel for a kernel: from the cache, or translated now.

    Args:
        arguments, threads, constants: as for `translate_kernel`.

    Raises:
        WarpCodegenError: the function cannot be translated.
    """
    name = found = claim = None
    if config.cache_kernels:
        try:
            name, found = identity.name_of(kernel, arguments, threads, constants)
        except Exception:
            # It has none, or looking at an object of somebody else's failed.
            name = None
    if name is not None:
        name, known, facts = _find(name, found.functions)
        if known is None:
            # Processes that start together translate a function once. The object is the claim.
            claim = _native.TranslationClaim(name)
            if claim.has_waited:
                name, known, facts = _find(name, found.functions)
        if known is not None:
            _tell(kernel, *facts)
            native = kernel.compile_module(known)
            kernel.names[native] = name
            return native
    return _translated(kernel, arguments, threads, constants, name, found, claim)


def _find(name, functions) -> tuple:
    """A translation whose static expressions give what they gave, and what `_tell` is told of it.

    One with others leads to another name, which they are a part of. Without a translation, the name
    is the one to keep it under.
    """
    for _ in range(_MOST_STATICS):
        known = _native.find_translation(name)
        if known is None:
            break
        try:
            facts, entries, together = marshal.loads(known.notes)
        except (EOFError, TypeError, ValueError):
            # The checksum fits, so somebody else wrote it.
            break
        now = statics.evaluate(entries, functions)
        if now == ([digest for *_, digest in entries], together):
            return name, known, facts
        name = blake2b(repr((name, now)).encode(), digest_size=32).hexdigest()
    return name, None, ()


class _GarbageKept(_native.Scope):
    """Stops garbage collection during a translation, which makes many objects that stay.

    Python would traverse all of them, and those of the program, again and again. `gc.freeze` and
    `gc.unfreeze` move them to the oldest generation afterwards, without a traversal. Objects that
    the program has frozen stay frozen.
    """

    _was_enabled = False

    def _enter(self):
        self._was_enabled = gc.isenabled()
        gc.disable()

    def _restore(self):
        if self._was_enabled:
            if not gc.get_freeze_count():
                gc.freeze()
                gc.unfreeze()
            gc.enable()


def _translated(kernel, arguments, threads, constants, name, found, claim):
    from warp._src.frontend.build import translate_kernel

    with _GarbageKept():
        module, session = translate_kernel(kernel, arguments, threads, constants)
    has_tiles = session.tile_builder is not None
    facts = (has_tiles, dict(session.handles), session.sums_winding)
    if has_tiles and threads == 1 and arguments is None and not session.depends_on_threads:
        facts = (*facts, _native.rank_of_warp_blocks(module))
    _tell(kernel, *facts)
    native = kernel.compile_module(module)
    if name is not None and not session.has_breakpoints:
        _keep(kernel, name, native, session, facts, found, claim)
    return native


def _keep(kernel, name, native, session, facts, found, claim) -> None:
    """Leaves a translation for other processes, if it depends on nothing but its name."""
    try:
        noted = statics.Notes(session.statics, found.functions)
    except Exception:
        return
    if _is_named(found) and (noted.identity is None or _is_named(noted.identity)):
        kept = marshal.dumps((facts, noted.entries, noted.together))
        _native.store_translation(name, native, kept, claim)
        kernel.names[native] = name


def _tell(kernel, has_tiles, handles, sums_winding, warp_rank=None) -> None:
    """Adds the launch hooks that a kernel needs."""
    if has_tiles:
        from warp._src.kernels.blocks import block_code

        blocks = block_code(kernel)
        if warp_rank is not None:
            # Bounds and the option fix the number of threads, for which files have code.
            is_fixed = "launch_bounds" in kernel.options or kernel.option("block_dim")
            blocks.warp_rank = 0 if is_fixed else warp_rank
    if handles or sums_winding:
        from warp._src.kernels.handle_checks import HandleChecks

        kernel.add_hook(HandleChecks(kernel, handles, sums_winding))


def _is_named(found) -> bool:
    """True if no function uses what has no name, other than in static expressions."""
    from warp._src.frontend.source import source_of

    for function, unnamed in zip(found.functions, found.unnamed, strict=True):
        words = texts.block_of(function).words
        if not unnamed and found.unnamed_attributes.isdisjoint(words):
            continue
        try:
            source = source_of(function)
        except errors.WarpError:
            return False
        words, attributes = statics.words_outside(source, function)
        if words & unnamed or attributes & found.unnamed_attributes:
            return False
    return True
