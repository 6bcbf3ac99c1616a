// Damaged text is rejected or accepted, and never crashes (`not` without
// `--crash` fails on a signal). Canonicalization runs on what was accepted.

// RUN: %python %S/Inputs/mutate.py %S/types.mlir 400 1 | not warp-opt -split-input-file -o /dev/null
// RUN: %python %S/Inputs/mutate.py %S/composites.mlir 400 2 | not warp-opt -split-input-file --canonicalize -o /dev/null
// RUN: %python %S/Inputs/mutate.py %S/arrays.mlir 400 3 | not warp-opt -split-input-file --canonicalize -o /dev/null
// RUN: %python %S/Inputs/mutate.py %S/builtins.mlir 400 4 | not warp-opt -split-input-file --canonicalize -o /dev/null
// RUN: %python %S/Inputs/mutate.py %S/fold-composites.mlir 400 5 | not warp-opt -split-input-file --canonicalize -o /dev/null
