// REQUIRES: amdgpu, package
// RUN: %python %S/../../scripts/lower_corpus.py --target gfx90a --target gfx1100 \
// RUN:   --build %build --llvm %llvm_tools | FileCheck %s

// Every kernel of the benchmarks and of this folder becomes assembly for waves
// of 64 and of 32 lanes: reductions, roots, output, searches, tiles.
// CHECK: gfx90a: [[ALL:[0-9]+]] of [[ALL]]{{$}}
// CHECK: gfx1100: [[ALL]] of [[ALL]]{{$}}
