// RUN: not warp-opt %s --warp-specialize="rank=5" 2>&1 | FileCheck %s --check-prefix=RANK
// RUN: not warp-opt %s --warp-specialize="target=riscv" 2>&1 | FileCheck %s --check-prefix=TARGET
// RUN: echo "func.func @f() { return }" | not warp-opt --warp-specialize 2>&1 | FileCheck %s --check-prefix=NONE

// RANK: error: expects 'rank' to be from 1 to 4, but got '5'
// TARGET: error: (C1) expects a target such as 'cpu', 'sm_90' or 'gfx90a', but got 'riscv'
// NONE: error: expects a function marked 'warp.kernel'
func.func @f() attributes {warp.kernel} {
  return
}
