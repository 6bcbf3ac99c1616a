// RUN: not warp-opt %s --warp-specialize="rank=5" 2>&1 | FileCheck %s --check-prefix=RANK
// RUN: not warp-opt %s --warp-specialize="target=riscv" 2>&1 | FileCheck %s --check-prefix=TARGET
// RUN: echo "func.func @f() { return }" | not warp-opt --warp-specialize 2>&1 | FileCheck %s --check-prefix=NONE

// RANK: error: expects 'rank' to be from 1 to 4, but got '5'
// TARGET: error: expects the target 'cpu' or 'sm_<number>', but got 'riscv'
// NONE: error: expects a function marked 'warp.kernel'
func.func @f() attributes {warp.kernel} {
  return
}
