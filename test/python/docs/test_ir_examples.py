"""IR in the references: it parses and verifies, and passes make of it what their example says."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
OPT = ROOT / "build" / "bin" / "warp-opt"
ARROW = re.compile(r"^// ==>(.*)$", re.MULTILINE)
pytestmark = pytest.mark.skipif(not OPT.exists(), reason="warp-opt is not built")


def blocks(page):
    """(heading, text) of the blocks of IR of a page; sketches are marked as no language."""
    heading, found = "", []
    text = (ROOT / "docs" / page).read_text()
    pattern = r"^###? `([^`]*)`|^```mlir\n(.*?)^```"
    for match in re.finditer(pattern, text, re.DOTALL | re.MULTILINE):
        if match[1]:
            heading = match[1].lstrip("-")
        else:
            found.append((heading, match[2]))
    return found


def opt(source, *options):
    command = [OPT, "--allow-unregistered-dialect", *options, "-"]
    done = subprocess.run(command, input=source, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def uncommented(text):
    return re.sub(r"//[^\n]*", "", text)


def defined(text):
    """Names of results and of arguments of blocks and functions."""
    found = set()
    for line in text.split("\n"):
        if match := re.match(r"\s*((?:%[\w:]+\s*,\s*)*%[\w:]+)\s*=", line):
            found |= {name.split(":")[0].strip() for name in match[1].split(",")}
        if "^bb" in line or "func.func" in line:
            found |= set(re.findall(r"(%\w+)\s*:\s*[!\w]", line))
    return found | set(re.findall(r"for (%\w+) =", text)) | set(re.findall(r"\((%\w+) = ", text))


def declarations(text):
    """Functions that a fragment calls, by the types at its calls."""
    found = {}
    for match in re.finditer(r"(func|llvm)\.call @(\w+)\([^)]*\)\s*: (\(.*?\)) -> (\S+)", text):
        result = "" if match[4] == "()" else f" -> {match[4]}"
        private = "private " if match[1] == "func" else ""
        result = result if match[1] == "func" else f" -> {match[4]}".replace(" -> ()", "")
        name = f"{match[1]}.func {private}@{match[2]}"
        found[match[2]] = name + match[3] + result
    for match in re.finditer(r"warp\.(?:vjp|jvp) @(\w+)\(.*?: (\(.*?\)), .*? -> ", text):
        arguments = match[2].strip("()").split(", ")
        named = ", ".join(f"%a{k}: {type}" for k, type in enumerate(arguments))
        found[match[1]] = f"func.func @{match[1]}({named}) -> f32 {{\nreturn %a0 : f32\n}}"
    defined = re.findall(r"\.func (?:private )?@(\w+)", text)
    kept = [each for name, each in found.items() if name not in defined]
    return "\n".join(kept)


def module_of(fragment, kind="func.func", attributes=""):
    """A module with a fragment, and the errors that are left.

    Values that the fragment only uses become arguments. Their types are those that the parser
    asks for, one error after the other.
    """
    fragment = fragment.strip()
    if fragment.startswith("#warp"):
        source = f"func.func private @f() attributes {{a = {fragment}}}"
        return source, *opt(source)
    if fragment.startswith(("func.func", "llvm.func", "gpu.module")):
        source = f"{declarations(fragment)}\n{fragment}"
        return source, *opt(source)
    used = dict.fromkeys(re.findall(r"%[\w$-]+", re.sub(r'"[^"]*"', "", uncommented(fragment))))
    types = {name: "i17" for name in used if name not in defined(uncommented(fragment))}
    for _ in range(len(types) + 1):
        arguments = ", ".join(f"{name}: {type}" for name, type in types.items())
        head = f"{declarations(fragment)}\n{kind} @example({arguments}) {attributes}{{\n"
        source = f"{head}{fragment}\n{kind[:4].rstrip('.')}.return\n}}"
        status, out, err = opt(source)
        asked = re.search(r"use of value '(%\w+)' expects .*?: '(.+?)' vs 'i17'", err)
        if not asked or types.get(asked[1]) != "i17":
            break
        types[asked[1]] = asked[2]
    return source, status, out, err


def cases(page):
    found = blocks(page)
    return [pytest.param(name, text, id=f"{name}-{k}") for k, (name, text) in enumerate(found)]


@pytest.mark.parametrize("name, text", [*cases("dialect.md"), *cases("passes.md")])
def test_every_example_verifies(name, text):
    for part in ARROW.sub("// ==>", text).split("// ==>"):
        _, status, _, err = module_of(part)
        assert status == 0, err


def test_most_operations_have_an_example():
    assert len(blocks("dialect.md")) > 35 and len(blocks("passes.md")) > 12


def operations(text):
    """Names of operations in order, without those that a wrapper adds."""
    text = text.replace("= call @", "= func.call @")
    found = re.findall(r"(?:^ *|= |\{ )\"?([a-z_]+\.[a-z_.]+)\"?", uncommented(text), re.MULTILINE)
    return [name for name in found if name not in ("func.func", "llvm.func")]


def is_subsequence(wanted, found):
    rest = iter(found)
    return all(name in rest for name in wanted)


def with_uses(source, fragment):
    """The last results of a fragment are operands of an unknown operation, so that none is dead."""
    if "@example" not in source:
        return source
    lines = [line for line in fragment.splitlines() if re.match(r"%[^=]* = ", line)][-1:]
    names = [line.split(" =")[0] for line in lines]
    for name in (each.split(":")[0].strip() for line in names for each in line.split(",")):
        at = source.rindex(source.split()[-2])
        _, _, err = opt(f'{source[:at]}"test.use"({name}) : (i17) -> ()\n{source[at:]}')
        type = re.search(r"'i17' vs '(.+?)'\n", err)[1]
        source = f'{source[:at]}"test.use"({name}) : ({type}) -> ()\n{source[at:]}'
    return source


KERNEL = ("func.func", "attributes {warp.kernel} ")
GPU = '#warp.variant<target = <name = "sm_90">, rank = 1>'
ENTRY = ("llvm.func", f"attributes {{warp.entry, warp.variant = {GPU}}} ")
# Passes that run on a fragment of a function; others ask for a whole kernel of their phase.
ALONE = {
    "warp-expand-roots": ENTRY,
    "warp-forward-stores": KERNEL,
    "warp-fuse-multiply-add": ("func.func", f"attributes {{warp.kernel, warp.variant = {GPU}}} "),
    "warp-lower-composites": KERNEL,
    "warp-lower-lanes": ("llvm.func", "attributes {warp.entry} "),
    "warp-lower-math": ENTRY,
    "warp-resolve-derivatives": KERNEL,
    "warp-specialize": KERNEL,
}


def test_examples_of_these_passes_are_printed():
    assert set(ALONE) <= {name for name, text in blocks("passes.md") if ARROW.search(text)}


@pytest.mark.parametrize("name, text", [c for c in cases("passes.md") if c.values[0] in ALONE])
def test_passes_do_what_their_example_says(name, text):
    """The operations of the second half, in their order, are among those that the pass leaves."""
    before, after = ARROW.split(text)[::2]
    option = re.search(r"with (.*)", ARROW.search(text)[1])
    source, status, _, err = module_of(before, *ALONE[name])
    assert status == 0, err
    source = with_uses(source, before)
    status, out, err = opt(source, f"--{name}={option[1]}" if option else f"--{name}")
    assert status == 0, err
    assert is_subsequence(operations(after), operations(out)), out
