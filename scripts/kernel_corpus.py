"""Writes warp IR of many kernels, a file for each: what back ends are compared and tested on.

    python scripts/kernel_corpus.py FOLDER [--adjoints] [--examples]

Kernels of benchmarks/_shape_*.py as their cases launch them, on request with their adjoints and
with the kernels of examples/. The first line of a file has the options of warp-opt that say what
kind of launch the kernel is for: `// rank=2,block-dim=64`.
"""

import argparse
import importlib
import re
import sys
from pathlib import Path

import warp as wp

ROOT = Path(__file__).resolve().parent.parent
# Any architecture: it only says that blocks have many threads.
ARCH = 90


def rank_of(text):
    """The launch dimensions that a kernel asks for."""
    results = re.findall(r"warp\.tid : (.*)", text)
    return max((line.count(",") + 1 for line in results), default=1)


def write(path, module, rank, block):
    options = [f"rank={min(rank, 4)}"] + ([f"block-dim={block}"] if block else [])
    path.write_text(f"// {','.join(options)}\n{module.text()}", encoding="utf-8")


def write_kernel(folder, name, kernel, rank, block, adjoint):
    from warp._src.derivatives.derivative import differentiate
    from warp._src.kernels.blocks import block_code

    native = kernel.prepare()
    if block:
        native = block_code(kernel).for_blocks(kernel, None, block)
    else:
        native = kernel.code_for(native, ARCH)
    text = native.module.text()
    found = re.search(r"warp.block_threads = (\d+)", text)
    if found:
        block = int(found[1])
    rank = rank or rank_of(text) + bool(found)
    write(folder / f"{name}.mlir", native.module, rank, block)
    if adjoint and kernel.option("enable_backward"):
        made = differentiate(native, (), False, tape=kernel.option("tape"))
        write(folder / f"{name}.adjoint.mlir", made.module, rank, block)


def write_cases(folder, adjoints):
    sys.path.insert(0, str(ROOT / "benchmarks"))
    data = importlib.import_module("_shape_data")
    importlib.import_module("_shape_cases")
    for name, case in data.CASES.items():
        one = case(data.Data("cpu"))
        rank = len(one.dim) if isinstance(one.dim, tuple) else 1
        rank += one.block > 0
        write_kernel(folder, name, one.kernel, rank, one.block, adjoints)


def write_examples(folder, adjoints):
    for path in sorted((ROOT / "examples").glob("**/*.py")):
        if "warp" not in path.read_text(encoding="utf-8"):
            continue
        sys.path.insert(0, str(path.parent))
        try:
            module = importlib.import_module(path.stem)
        except (ImportError, SystemExit):
            continue  # a library that is not installed here
        for name, kernel in vars(module).items():
            if isinstance(kernel, wp.Kernel) and not kernel.is_generic:
                write_kernel(folder, f"{path.stem}.{name}", kernel, 0, 0, adjoints)


def write_corpus(folder, adjoints=False, examples=False):
    """Writes a file for each kernel, and with adjoints one for each of these."""
    folder.mkdir(parents=True, exist_ok=True)
    wp.config.quiet = True
    write_cases(folder, adjoints)
    if examples:
        write_examples(folder, adjoints)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--adjoints", action="store_true")
    parser.add_argument("--examples", action="store_true")
    options = parser.parse_args()
    write_corpus(options.folder, options.adjoints, options.examples)


if __name__ == "__main__":
    main()
