"""Check the language of comments, docstrings and documents.

    check_language.py [FILE ...]

Without arguments every source and document is checked that git tracks or does not ignore. Five
rules, each printed as `file:line: rule`:

- No sentence of a comment, docstring or document begins with one of `OPENINGS`: such a clause has
  no subject that a reader could look up.
- No paragraph of a comment in C++ or tablegen begins with one of `CLAUSES`, for the same reason:
  `The slot of a handle`, not `Where a handle's slot is`.
- No title, the first line of a C++ file or a Python module, begins with one of `QUESTIONS`: it is
  the field's term, then the effect.
- No text contains one of `PRIVATE`, expressions that the field has a standard term for.
- `lib` and `include` contain each of `REQUIRED` at least once, so that a search for the standard
  term finds the place.

The exit status is 1 if a rule is broken.
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
OPENINGS = ("What", "Whether", "Of", "Those")
CLAUSES = ("Where", "Which")
QUESTIONS = ("What", "Which", "Where", "How", "Who", "Whether", "Between", "From", "Of", "Those")
PRIVATE = {
    r"copy engine": "TMA (the copy engine is the unit behind cudaMemcpyAsync)",
    r"memory of (?:the|a|its) block|block's memory|block memory": "shared memory",
    r"squares? (?:of elements )?changes? hands": "a tile is transposed through shared memory",
    r"under way": "in flight, in progress",
    r"had again": "recovered",
    r"queue at one bank": "bank conflict",
    r"queues? at": "contention",
    r"lies? anywhere": "scattered",
    r"threads (?:that )?(?:may |can |do not )?meet\b": "threads conflict, or wait at a barrier",
    r"hand(?:s|ed)? on\b": "forward, pass on",
    r"takes? turns": "alternate, serialised",
    r"\bdear\b": "expensive",
    r"first code|better code": "tier-0 code, tier-1 code",
    r"sums that travel": "ring reduction",
    r"whole lines of memory": "coalesced accesses",
}
REQUIRED = (
    "alias analysis",
    "bank conflict",
    "coalesc",
    "liveness",
    "lockstep",
    "occupancy",
    "register pressure",
    "rematerial",
    "shared memory",
    "software pipelin",
    "TMA",
    "unroll-and-jam",
)
SOURCES = (".cpp", ".h", ".td", ".py", ".md", ".mlir", ".sh", ".txt")
# References that are generated, and lists of the peer's names.
GENERATED = ("docs/builtins.md", "docs/dialect.md", "docs/passes.md", "docs/compatibility.md")
SKIPPED = (*GENERATED, "docs/peer-names.txt", "test/peer/", "scripts/check_language.py")

Comment = tuple[int, str]


def python_text(source: str) -> Iterator[Comment]:
    """Comments and docstrings, a line each."""
    statement = True
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string.lstrip("#:! ")
        elif token.type == tokenize.STRING and statement:
            for number, line in enumerate(token.string.strip("rR\"'").split("\n")):
                yield token.start[0] + number, line
        if token.type not in (tokenize.COMMENT, tokenize.NL):
            statement = token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
            statement = statement or token.type == tokenize.ENCODING


def marked_text(source: str, mark: str) -> Iterator[Comment]:
    """Comments that run from `mark` to the end of the line; text lines of `.td` descriptions."""
    description = False
    for number, line in enumerate(source.split("\n"), 1):
        match = re.match(rf"\s*{mark}+[!<]*(?: |$)(.*)", line)
        title = re.match(r"//===-+ \S+ - (.*?) *-*(?:\*-.*)?===//$", line)
        if title:
            yield number, title[1]
        elif match and not line.lstrip().startswith("//==="):
            yield number, match[1]
        elif description:
            yield number, line
        description = ("[{" in line or description) and "}]" not in line


def document_text(source: str) -> Iterator[Comment]:
    """The text of a Markdown page, without its code."""
    code = False
    for number, line in enumerate(source.split("\n"), 1):
        if line.startswith("```"):
            code = not code
        yield number, "" if code else re.sub(r"^[#|*\-> ]+", "", line)


def text_of(path: str, source: str) -> Iterator[Comment]:
    if path.endswith(".py"):
        return python_text(source)
    if path.endswith((".md", ".txt")):
        return document_text(source)
    return marked_text(source, "#" if path.endswith(".sh") else "//")


def sentences(lines: Iterator[Comment]) -> Iterator[Comment]:
    """The first words of each sentence, with its line. A gap or an indented line ends one."""
    ended, last = True, -1
    for number, line in lines:
        if number != last + 1 or not line.strip():
            ended = True
        last = number
        for match in re.finditer(r"(^|(?<=[.:!?]) )\s*([A-Z][a-z]+)\b", line):
            if match.start() > 0 or ended:
                yield number, match[2]
        if line.strip():
            ended = line.rstrip().endswith((".", ":", "!", "?", "```"))


def paragraphs(lines: Iterator[Comment]) -> Iterator[Comment]:
    """The first word of each paragraph, with its line. A gap or an empty line ends one."""
    ended, last = True, -1
    for number, line in lines:
        if (ended or number != last + 1) and line.strip():
            yield number, re.match(r"\W*(\w*)", line)[1]
        ended, last = not line.strip(), number


def title_of(path: str, source: str) -> str:
    """The title in the first line of a C++ file or a Python module."""
    first = source.split("\n", 1)[0]
    if path.endswith(".py"):
        match = re.match(r'[rR]?"""(.*)', first)
    else:
        match = re.match(r"//===-+ \S+ - (.*)", first)
    return match[1] if match else ""


def broken_rules(path: str, source: str) -> Iterator[tuple[int, str]]:
    """Line and message of each broken rule of one file."""
    lines = list(text_of(path, source))
    opening = re.match(r"\w*", title_of(path, source))[0]
    if opening in QUESTIONS:
        yield 1, f"a title begins with '{opening}'; begin with the field's term"
    for number, word in sentences(iter(lines)):
        if word in OPENINGS:
            yield number, f"a sentence begins with '{word}'; begin with its subject"
    if path.endswith((".cpp", ".h", ".td")):
        for number, word in paragraphs(iter(lines)):
            if word in CLAUSES:
                yield number, f"a comment begins with '{word}'; begin with its subject"
    if path.startswith("python/bindings/"):
        # Docstrings are literals; messages begin with a small letter.
        for number, line in enumerate(source.split("\n"), 1):
            for word in re.findall(rf'"({"|".join(OPENINGS)}) ', line):
                yield number, f"a docstring begins with '{word}'; begin with its subject"
    for number, line in lines:
        for pattern, term in PRIVATE.items():
            if re.search(pattern, line):
                yield number, f"'{re.search(pattern, line)[0]}' is not a term of the field: {term}"


def tracked() -> list[str]:
    """Paths of sources and documents, new ones too."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [
        name
        for name in sorted(set(listed.stdout.split("\n")))
        if name.endswith(SOURCES) and not name.startswith(SKIPPED) and (ROOT / name).is_file()
    ]


def missing_terms(texts: dict[str, str]) -> list[str]:
    """Standard terms that no file of `lib` or `include` contains."""
    whole = "\n".join(text for name, text in texts.items() if name.startswith(("lib/", "include/")))
    return [term for term in REQUIRED if term.lower() not in whole.lower()]


def main(arguments: list[str]) -> int:
    texts = {name: (ROOT / name).read_text() for name in arguments or tracked()}
    found = [
        f"{name}:{number}: {message}"
        for name, text in texts.items()
        for number, message in broken_rules(name, text)
    ]
    if not arguments:
        found += [f"lib, include: no text has the term '{term}'" for term in missing_terms(texts)]
    print("\n".join(found) if found else f"{len(texts)} files follow the rules")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
