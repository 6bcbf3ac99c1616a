// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,lineinfo | FileCheck %s --check-prefix=LINES
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,max-registers=32,block-dim=64 | FileCheck %s --check-prefix=LIMITS
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90 | FileCheck %s --check-prefix=EXACT
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,fast-math | FileCheck %s --check-prefix=FAST
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_120 | FileCheck %s --check-prefix=BLACKWELL

// The effect of each option on the code.

// LINES: .loc 1 12 5
// LINES: .file 1 "{{.*}}k.py"
// LINES-NOT: .section

// LIMITS: .maxntid 64
// LIMITS: .maxnreg 32

// Quotients are rounded, and subnormals kept, unless fast math is on.
// EXACT: rcp.rn.f32
// FAST-NOT: rcp.rn
// FAST: rcp.approx.ftz.f32

// A newer GPU needs a newer PTX.
// BLACKWELL: .version 8.7
// BLACKWELL: .target sm_120
func.func @f(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %one = warp.constant 1.0 : f32
  %1 = warp.div(%one, %0) : (f32, f32) -> f32 loc("k.py":12:5)
  warp.store %1, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
} loc("k.py":10:1)
