// RUN: not warp-opt %s --warp-emit=riscv 2>&1 | FileCheck %s --check-prefix=STAGE
// RUN: not warp-opt %s --warp-emit=ptx 2>&1 | FileCheck %s --check-prefix=PTX
// RUN: not warp-opt %s --warp-emit=asm --warp-options=target=gpu 2>&1 | FileCheck %s --check-prefix=TARGET
// RUN: not warp-opt %s --warp-emit=asm --warp-options=target=sm_1 2>&1 | FileCheck %s --check-prefix=SM
// RUN: not warp-opt %s --warp-emit=asm --warp-options=target=cpu:abacus 2>&1 | FileCheck %s --check-prefix=CPU
// RUN: echo "func.func @f() {" | not warp-opt --warp-emit=warp 2>&1 | FileCheck %s --check-prefix=TEXT
// RUN: echo "module {}" | not warp-opt --warp-emit=llvm 2>&1 | FileCheck %s --check-prefix=EMPTY

// STAGE: no stage 'riscv'; there are warp, thread, launch, gpu, llvm, ptx and asm
// PTX: stage 'ptx' needs a GPU target, but the target is 'cpu'
// TARGET: expects a target such as 'cpu', 'sm_90' or 'gfx90a', but got 'gpu'
// SM: no code generator for target 'sm_1'
// CPU: no code generator for target 'cpu:abacus'
// TEXT: <ir>:{{.*}}: error
// EMPTY: expects a function marked 'warp.kernel'
// EMPTY: in pass 'warp-verify-warp'; the IR before it is in '
func.func @f() attributes {warp.kernel} {
  return
}
