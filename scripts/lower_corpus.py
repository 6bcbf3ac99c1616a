"""Lowers many kernels to AMDGPU assembly, and counts those that get there.

    python scripts/lower_corpus.py --target gfx90a --target gfx1100 [--adjoints] [--examples]
                                   [--build build] [--llvm /usr/lib/llvm-22/bin] [--keep FOLDER]

The kernels are those of kernel_corpus.py and, as the code that each of their functions is, those of
test/Pipeline. Each goes through `warp-opt`, `mlir-translate`, `llvm-link` with the device library
and `llc`, to an object file without undefined symbols but those that a launch sets. Prints
`N of N` for each target, and what failed.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import kernel_corpus

ROOT = kernel_corpus.ROOT
KERNEL = re.compile(r"attributes \{[^}]*warp\.kernel", re.DOTALL)
# Errors, and tiles that need more shared memory than the 64 KiB of these GPUs.
EXCLUDED = {"errors.mlir", "malformed-fuzz.mlir", "recursion-errors.mlir"}
EXCLUDED |= {"tma-products.mlir", "warpgroups.mlir"}


def pipeline_kernels():
    """The parts of files in test/Pipeline that hold a kernel, by name."""
    for path in sorted((ROOT / "test" / "Pipeline").glob("*.mlir")):
        if path.name in EXCLUDED:
            continue
        parts = re.split(r"^(?:// -----|//--- .*)$", path.read_text(encoding="utf-8"), flags=re.M)
        for number, part in enumerate(parts):
            if len(KERNEL.findall(part)) == 1:
                yield f"{path.stem}.{number}", part, kernel_corpus.rank_of(part)


class Lowering:
    """The tools, for one target."""

    def __init__(self, options, target, folder):
        self.target = target
        build, llvm = Path(options.build), Path(options.llvm)
        self.warp_opt = build / "bin" / "warp-opt"
        self.tools = {name: llvm / name for name in ("mlir-translate", "llvm-link", "llc")}
        self.library = folder / f"library.{target}.bc"
        # Without the list that keeps every function.
        library = build / "bitcode" / "devicelib_amd" / "devicelib_amd.bc"
        extract = [llvm / "llvm-extract", "--delete", "--glob=llvm.compiler.used"]
        subprocess.run([*extract, library, "-o", self.library], check=True)

    def run(self, path):
        """Why a kernel does not get to an object file; empty if it does."""
        options = path.read_text(encoding="utf-8").split("\n", 1)[0].removeprefix("// ")
        stem = path.with_suffix(f".{self.target}")
        pipeline = f"to-llvm target={self.target},packed=65535,index32,{options}"
        steps = [
            [self.warp_opt, path, f"--warp-pipeline={pipeline}", "-o", f"{stem}.mlir"],
            [
                self.tools["mlir-translate"],
                "--allow-unregistered-dialect",
                "--mlir-to-llvmir",
                f"{stem}.mlir",
                "-o",
                f"{stem}.ll",
            ],
            [
                self.tools["llvm-link"],
                "--only-needed",
                "--internalize",
                f"{stem}.ll",
                self.library,
                "-o",
                f"{stem}.bc",
            ],
            [
                self.tools["llc"],
                "-mtriple=amdgcn-amd-amdhsa",
                f"-mcpu={self.target}",
                "-O1",
                f"{stem}.bc",
                "-o",
                f"{stem}.s",
            ],
        ]
        for step in steps:
            done = subprocess.run(step, capture_output=True, text=True)
            if done.returncode:
                first = next(
                    iter(done.stderr.strip().splitlines()), f"ended with {done.returncode}"
                )
                return f"{Path(step[0]).name}: {first}"
        text = Path(f"{stem}.s").read_text(encoding="utf-8")
        if ".amdhsa_kernel" not in text:
            return "llc: no kernel in the assembly"
        missing = set(re.findall(r"\b((?:warp|__nv|__ocml)_\w+)@(?:rel|gotpcrel)", text))
        missing -= set(re.findall(r"^(\w+):", text, flags=re.M))
        missing -= set(re.findall(r"\.(?:local|globl|comm|protected)\s+(\w+)", text))
        return f"undefined: {', '.join(sorted(missing))}" if missing else ""


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--target", action="append", required=True)
    parser.add_argument("--adjoints", action="store_true")
    parser.add_argument("--examples", action="store_true")
    parser.add_argument("--build", default=ROOT / "build")
    parser.add_argument("--llvm", default="/usr/lib/llvm-22/bin")
    parser.add_argument("--keep", help="folder for the files of all steps")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(options.keep or scratch)
        kernel_corpus.write_corpus(folder, options.adjoints, options.examples)
        for name, text, rank in pipeline_kernels():
            (folder / f"pipeline.{name}.mlir").write_text(f"// rank={rank}\n{text}")
        failed = False
        paths = sorted(
            p for p in folder.glob("*.mlir") if not re.search(r"\.gfx\w+\.mlir$", p.name)
        )
        for target in options.target:
            lowering = Lowering(options, target, folder)
            with ThreadPoolExecutor(os.cpu_count()) as pool:
                problems = list(pool.map(lowering.run, paths))
            wrong = [(path, why) for path, why in zip(paths, problems, strict=True) if why]
            for path, why in wrong:
                print(f"{target} {path.stem}: {why}")
            print(f"{target}: {len(paths) - len(wrong)} of {len(paths)}")
            failed |= bool(wrong)
    sys.exit(failed)


if __name__ == "__main__":
    main()
