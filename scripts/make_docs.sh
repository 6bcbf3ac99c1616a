#!/bin/bash
# Refresh the committed references under docs/ from what the build generated.
#   make_docs.sh [FOLDER]   writes there instead of docs/
set -euo pipefail
cd "$(dirname "$0")/.."

folder=${1:-docs}
tblgen="/usr/lib/llvm-22/bin/mlir-tblgen -I include -I include/WarpDialect \
  -I /usr/lib/llvm-22/include"
mkdir -p "$folder"
cp build/generated/{builtins,launch}.md "$folder/"
$tblgen -gen-pass-doc include/WarpDialect/Passes.td -o "$folder/passes.md"
$tblgen -gen-pass-doc include/WarpDialect/TilePasses.td >> "$folder/passes.md"
$tblgen -gen-dialect-doc -dialect=warp include/WarpDialect/WarpOps.td \
  -o "$folder/dialect.md"
$tblgen -gen-op-doc -dialect=warp include/WarpDialect/WarpLibraryOps.td \
  >> "$folder/dialect.md"
$tblgen -gen-op-doc -dialect=warp include/WarpDialect/WarpLaneOps.td \
  >> "$folder/dialect.md"
$tblgen -gen-typedef-doc -dialect=warp include/WarpDialect/WarpTileTypes.td \
  >> "$folder/dialect.md"
$tblgen -gen-op-doc -dialect=warp include/WarpDialect/WarpTileOps.td \
  >> "$folder/dialect.md"
PYTHONPATH=build/python WARP_QUIET=1 "${PYTHON:-.venv/bin/python}" \
  scripts/compatibility.py "$folder/compatibility.md"
