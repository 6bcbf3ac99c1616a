// RUN: warp-opt %s --warp-convert-to-llvm --warp-verify-llvm | FileCheck %s
// RUN: sed 's/warp.entry/warp.entry, warp.variant = #fast/' %s | warp-opt --warp-convert-to-llvm | FileCheck %s --check-prefix=FAST

#fast = #warp.variant<target = <name = "cpu", bits = 128>, fast_math = true>

// Structured control flow becomes branches; products and sums stay as
// rounded as they are, unless the launch asks for fast arithmetic.
// CHECK-LABEL: llvm.func @loop
// CHECK: llvm.cond_br
// CHECK: llvm.fmul %{{[^ ]*}}, %{{[^ ]*}} : f32
// CHECK: llvm.fadd %{{[^ ]*}}, %{{[^ ]*}} : f32
// CHECK: llvm.intr.sqrt
// CHECK: llvm.return
// FAST: llvm.fmul %{{.*}} {fastmathFlags = #llvm.fastmath<nsz, arcp, contract, afn, reassoc>}
llvm.func @loop(%x: f32, %n: i32) -> f32 attributes {warp.entry} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %sum = scf.for %i = %c0 to %n step %c1 iter_args(%s = %x) -> (f32) : i32 {
    %p = arith.mulf %s, %x : f32
    %q = arith.addf %p, %x : f32
    scf.yield %q : f32
  }
  %root = math.sqrt %sum : f32
  llvm.return %root : f32
}
