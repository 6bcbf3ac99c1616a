"""Functions made from text or from a syntax tree, which libraries generate.

A function that is made here is translated as one from a file is: messages show its lines, and the
kernel cache knows it by its text, its names and their values, so that other processes find its
translation. Functions of one text share a code object, as closures of one factory do.
"""

from __future__ import annotations

import types
import typing
from _blake2 import blake2b

from warp._src.argument_kinds import DICT, FUNCTION, NONE, TEXT, Kind
from warp._src.arguments import checked, shown
from warp._src.kernels import texts

if typing.TYPE_CHECKING:
    import ast
    from collections.abc import Mapping, Sequence

# Code objects with their factories, by the tree, its file and the names that it takes.
_known: dict = {}
_INNER = "made_function"
_TRANSFORMERS = Kind(
    "a list of `ast.NodeTransformer`s",
    lambda value: isinstance(value, (list, tuple)) and all(hasattr(one, "visit") for one in value),
)
_TREE = Kind("an `ast.FunctionDef`", lambda value: type(value).__name__ == "FunctionDef")


@checked(text=TEXT, names=DICT | NONE, module=TEXT | NONE)
def function_from_text(
    text: str, names: Mapping[str, object] | None = None, *, module: str | None = None
) -> types.FunctionType:
    """Makes a Python function from text, to be given to `wp.func` or `wp.kernel`.

    Error messages show lines of the text. The function has a lasting name in the kernel cache if
    the values of `names` have one: types, numbers, functions of kernels and modules do.

    Args:
        text: one `def` without decorators; may be indented.
        names: values of the names that the text uses, but for its own variables and builtins.
        module: name of the module that kernels made of it belong to, by default the caller's.

    Raises:
        SyntaxError: `text` is not Python.
        ValueError: `text` is not one `def` without decorators.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> text = "def area(r: float):\\n    return wp.pi * r * r\\n"
        >>> area = wp.func(extend.function_from_text(text, {"wp": wp}))
        >>> round(area(2.0), 4)
        12.5664
    """
    tree, file, lines = _parsed("function_from_text", text)
    names = dict(names or {})
    return _made(tree, file, names, {"__name__": module or _module_of_caller()}, lines, True)


def function_of_caller(text: str, frame: types.FrameType) -> types.FunctionType:
    """Makes a Python function from text, as if `exec` had run it in a frame.

    Names mean what they mean there: local variables as they are now, global ones when the function
    is translated.
    """
    import ast

    tree, file, lines = _parsed("source", text)
    names: dict = {}
    if frame.f_locals is not frame.f_globals:
        used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        names = {name: value for name, value in frame.f_locals.items() if name in used}
    return _made(tree, file, names, frame.f_globals, lines, True)


def with_source(func: types.FunctionType, text: str) -> types.FunctionType:
    """A copy of a Python function with the body of a text, whose decorators do not count.

    Raises:
        ValueError: the text is not one `def` with the parameters of the function.
    """
    tree, file, lines = _parsed("source", text, decorated=True)
    expected = func.__code__.co_varnames[: func.__code__.co_argcount]
    given = tuple(one.arg for one in tree.args.args)
    if given != expected:
        raise ValueError(
            f"source of '{func.__name__}': expects the parameters ({', '.join(expected)}), but got "
            f"({', '.join(given)})"
        )
    return _copy(func, tree, file, lines)


def _parsed(caller, text, decorated=False) -> tuple:
    """The definition in a text, the file that stands for it, and its lines."""
    import ast
    import linecache
    import textwrap

    text = textwrap.dedent(text)
    tree, *others = ast.parse(text).body or [ast.Pass()]
    if others or not isinstance(tree, ast.FunctionDef) or (tree.decorator_list and not decorated):
        also = "" if decorated else " without decorators"
        raise ValueError(f"{caller}: expects one `def`{also}")
    tree.decorator_list = []
    digest = blake2b(text.encode("utf-8", "surrogatepass"), digest_size=8).hexdigest()
    file = f"<{tree.name} {digest}>"
    lines = text.splitlines(keepends=True)
    linecache.cache[file] = (len(text), None, lines, file)
    return tree, file, lines


@checked(tree=_TREE, names=DICT | NONE, file=TEXT | NONE, module=TEXT | NONE)
def function_from_tree(
    tree: ast.FunctionDef,
    names: Mapping[str, object] | None = None,
    *,
    file: str | None = None,
    module: str | None = None,
) -> types.FunctionType:
    """Makes a Python function from a syntax tree; otherwise as `function_from_text`.

    Args:
        tree: the definition; it is not changed, and its decorators do not count.
        names: values of the names that the tree uses.
        file: file that the positions of its nodes are in, whose lines error messages show; by
            default they show the tree as text.
        module: as for `function_from_text`.

    Raises:
        SyntaxError: the tree is not valid Python.

    Example:
        >>> import ast
        >>> import warp as wp
        >>> from warp import extend
        >>> (tree,) = ast.parse("def double(x: float):\\n    return 2.0 * x\\n").body
        >>> double = wp.func(extend.function_from_tree(tree))
        >>> double(1.5)
        3.0
    """
    import ast
    import copy

    plain = copy.copy(tree)
    plain.decorator_list = []
    ast.fix_missing_locations(plain)
    text = ast.unparse(plain) + "\n"
    module = module or _module_of_caller()
    if file is None:
        return function_from_text(text, names, module=module)
    lines = text.splitlines(keepends=True)
    return _made(plain, file, dict(names or {}), {"__name__": module}, lines)


@checked(func=FUNCTION, transformers=_TRANSFORMERS, names=DICT | NONE, annotations=DICT | NONE)
def transformed_function(
    func: types.FunctionType,
    transformers: Sequence[ast.NodeTransformer],
    *,
    names: Mapping[str, object] | None = None,
    annotations: Mapping[str, object] | None = None,
) -> types.FunctionType:
    """A copy of a Python function whose syntax tree has gone through `ast.NodeTransformer`s.

    `wp.Kernel` and `wp.Function` do this with their `code_transformers`. The kernel cache knows the
    result by what the transformers made, so the translation is found by other processes. Nodes
    without positions get those of their parents: messages show lines of the function's file.

    Args:
        func: the function; its globals, captured variables and defaults are those of the copy.
        transformers: get the tree one after the other.
        names: values of further names that the new tree uses.
        annotations: types of the parameters and of "return", by default those of `func`.

    Raises:
        WarpCodegenError: the source of the function is not available.
        TypeError: a transformer does not return a function definition.
        SyntaxError: the new tree is not valid Python.

    Example:
        >>> import ast
        >>> import warp as wp
        >>> from warp import extend
        >>> class Doubled(ast.NodeTransformer):
        ...     def visit_Constant(self, node):
        ...         return ast.Constant(2.0 * node.value)
        >>> def one(x: float):
        ...     return x + 1.0
        >>> extend.transformed_function(one, [Doubled()])(1.0)  # doctest: +SKIP
        3.0
    """
    import ast
    import copy

    from warp._src.frontend.source import source_of

    source = source_of(func)
    original = texts.block_of(func).text.splitlines(keepends=True)
    tree = copy.deepcopy(source.tree)
    ast.increment_lineno(tree, source.line_offset)
    tree.decorator_list = []
    for transformer in transformers:
        tree = transformer.visit(tree)
        if not isinstance(tree, ast.FunctionDef):
            raise TypeError(
                f"code transformer '{type(transformer).__name__}' of '{func.__name__}': expects a "
                f"function definition as result, but got {shown(tree)}"
            )
        ast.fix_missing_locations(tree)
    lines = [*original, *(ast.unparse(tree) + "\n").splitlines(keepends=True)]
    return _copy(func, tree, source.file, lines, names, annotations)


def _copy(func, tree, file, lines, names=None, annotations=None):
    """A function with the globals, captured variables and defaults of another one."""
    cells = dict(zip(func.__code__.co_freevars, func.__closure__ or (), strict=True))
    cells |= {name: types.CellType(value) for name, value in (names or {}).items()}
    code, _ = _compiled(tree, file, tuple(sorted(cells)), lines, evaluated=False)
    closure = tuple(cells[name] for name in code.co_freevars)
    made = types.FunctionType(code, func.__globals__, tree.name, func.__defaults__, closure)
    made.__kwdefaults__, made.__doc__ = func.__kwdefaults__, func.__doc__
    made.__module__, made.__qualname__ = func.__module__, func.__qualname__
    made.__annotations__ = dict(func.__annotations__ if annotations is None else annotations)
    return made


def _module_of_caller() -> str:
    from warp._src.version import calling_frame

    return calling_frame().f_globals.get("__name__", "__main__")


def _made(tree, file, names, space, lines, is_whole=False):
    """A function whose names are captured variables: code that is shared looks for these anew.

    Args:
        space: its globals.
    """
    code, factory = _compiled(tree, file, tuple(sorted(names)), lines, is_whole=is_whole)
    found: dict = {}
    exec(factory, space, found)
    plain = found["factory"](*(names[name] for name in sorted(names)))
    made = types.FunctionType(code, space, tree.name, plain.__defaults__, plain.__closure__)
    made.__kwdefaults__, made.__annotations__ = plain.__kwdefaults__, plain.__annotations__
    made.__doc__, made.__qualname__ = plain.__doc__, tree.name
    return made


def _compiled(tree, file, free, lines, evaluated=True, is_whole=False) -> tuple:
    """The code object of a function and that of a module with a factory of it, compiled once.

    Args:
        tree: its definition, with positions in the file.
        free: names that the factory takes as arguments.
        lines: its text.
        evaluated: keeps annotations and defaults.
        is_whole: the lines are the definition, as it was parsed: they tell it from others.
    """
    import ast

    dumped = None if is_whole else ast.dump(tree, include_attributes=True)
    key = dumped, file, free, tuple(lines), evaluated
    found = _known.get(key)
    if found is not None:
        return found
    # Under another name, so that the text may call other functions of its own.
    parameters = tree.args if evaluated else _bare(tree.args)
    inner = ast.FunctionDef(_INNER, parameters, tree.body, [])
    ending = ast.Return(ast.Name(_INNER, ast.Load()))
    arguments = ast.arguments([], [ast.arg(name) for name in free], None, [], [], None, [])
    outer = ast.FunctionDef("factory", arguments, [inner, ending], [])
    for node in (inner, ending, outer):
        ast.copy_location(node, tree)
    module = ast.fix_missing_locations(ast.Module([outer], []))
    factory = compile(module, file, "exec", dont_inherit=True)
    code = _code(_code(factory, "factory"), _INNER)
    code = code.replace(co_name=tree.name)
    _known[key] = code, factory
    _register(code, tree, file, lines)
    return code, factory


def _code(code, name) -> types.CodeType:
    """The code object of a name in another one."""
    found = (one for one in code.co_consts if isinstance(one, types.CodeType))
    return next(one for one in found if one.co_name == name)


def _bare(given):
    """Parameters without annotations and defaults."""
    import ast

    def bare(one):
        return None if one is None else ast.arg(one.arg)

    return ast.arguments(
        posonlyargs=list(map(bare, given.posonlyargs)),
        args=list(map(bare, given.args)),
        vararg=bare(given.vararg),
        kwonlyargs=list(map(bare, given.kwonlyargs)),
        kw_defaults=[None] * len(given.kwonlyargs),
        kwarg=bare(given.kwarg),
        defaults=[],
    )


def _register(code, tree, file, lines) -> None:
    """Tells the front end, and the names of the kernel cache, how the code was made."""
    from warp._src.frontend.source import Source, sources

    texts.keep_made(code, lines)
    sources[code] = Source(tree, file, 0, tree.name)
