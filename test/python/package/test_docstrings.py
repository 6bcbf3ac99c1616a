"""Public names say what they are, and functions that raise say when."""

import ast
import importlib
import inspect
import textwrap

import pytest

MODULES = [
    *("warp", "warp.utils", "warp.sparse", "warp.optim", "warp.optim.linear", "warp.render"),
    *("warp.autograd", "warp.geometry", "warp.report", "warp.types", "warp.saved"),
    "warp.extend",
]


def plain(member):
    """The function behind a method or a property, None for anything else."""
    if isinstance(member, property):
        member = member.fget
    elif isinstance(member, (staticmethod, classmethod)):
        member = member.__func__
    return member if inspect.isfunction(member) else None


def is_ours(thing) -> bool:
    return (getattr(thing, "__module__", None) or "").startswith("warp")


def public_names(module):
    """Names with what they stand for: functions, classes and their methods and properties."""
    for name, thing in vars(module).items():
        if name.startswith("_") or not is_ours(thing):
            continue
        if inspect.isfunction(thing):
            yield name, thing
        elif inspect.isclass(thing):
            yield name, thing
            for key, member in vars(thing).items():
                function = plain(member)
                if not key.startswith("_") and function and is_ours(function):
                    yield f"{name}.{key}", member


def inherited(qualified, module):
    """True if a base class says what a method does."""
    owner, _, name = qualified.partition(".")
    bases = getattr(module, owner).__mro__[1:] if name else ()
    return any(getattr(getattr(base, name, None), "__doc__", None) for base in bases)


def raises(function) -> bool:
    """True if it has a `raise` of its own, not counting methods that subclasses have to have."""
    if function.__name__ == "<lambda>":
        return False
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    return any(
        isinstance(node, ast.Raise) and "NotImplementedError" not in ast.dump(node)
        for node in ast.walk(tree)
    )


@pytest.mark.parametrize("name", MODULES)
def test_everything_public_is_described(name):
    module = importlib.import_module(name)
    silent, unsaid = [], []
    for qualified, thing in public_names(module):
        if not inspect.getdoc(thing) or not thing.__doc__:
            if not inherited(qualified, module):
                silent.append(qualified)
        elif (function := plain(thing)) and raises(function) and "Raises:" not in thing.__doc__:
            unsaid.append(qualified)
    assert silent == []
    assert unsaid == []
