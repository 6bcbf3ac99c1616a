// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=255 non-negative=255" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90" | FileCheck %s --check-prefix=NONE
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=255 non-negative=255 debug" | FileCheck %s --check-prefix=NONE
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=cpu packed=255 non-negative=255" | FileCheck %s --check-prefix=NONE

// Arrays that may have gaps, a launch for debugging, the CPU: each thread
// accesses its own element.
// NONE-NOT: activemask

// Each thread has a row. In a loop the threads of a whole warp that are at the
// same place of their rows move its elements together: eight threads for each
// element of seven words, so eight words a thread. Elements are seven words
// apart in the slab, 4 x 7 from word to word of a share. A grid of fewer than
// 32 blocks of 8 warps waits for latency alone, so its threads move their own.
// CHECK: llvm.mlir.global internal @{{.*}}() {addr_space = 3 {{.*}}} : !llvm.array<7168 x i8>
// CHECK-LABEL: llvm.func @along(
// CHECK-SAME: nvvm.kernel
// CHECK: nvvm.read.ptx.sreg.nctaid.z
// CHECK: %[[LEAST:.*]] = llvm.mlir.constant(32 : i64) : i64
// CHECK: %[[CROWDED:.*]] = llvm.icmp "uge" %{{.*}}, %[[LEAST]]
// CHECK: llvm.cond_br %[[CROWDED]]
// CHECK: "llvm.nvvm.activemask"
// CHECK: nvvm.shfl.sync
// CHECK: "llvm.nvvm.vote.all.sync"
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-8: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-COUNT-2: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: llvm.getelementptr inbounds %{{.*}}[56] : (!llvm.ptr<3>) -> !llvm.ptr<3>, f32
// CHECK-COUNT-6: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-7: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK: llvm.br
// CHECK-COUNT-7: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK: "llvm.nvvm.activemask"
// CHECK: nvvm.shfl.sync
// CHECK: "llvm.nvvm.vote.all.sync"
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-7: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-8: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK-COUNT-8: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-7: llvm.store {{.*}} : f32, !llvm.ptr<1>
!t = !warp.transform<f32>
func.func @along(%x: !warp.array<2 x !t>, %at: !warp.array<1 x si32>,
                 %y: !warp.array<2 x !t>, %n: si32) attributes {warp.kernel} {
  %i = warp.tid : si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %count = warp.cast %n : si32 to i32
  scf.for %k = %c0 to %count step %c1 : i32 {
    %number = warp.cast %k : i32 to si32
    %from = warp.load %at[%number] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%i, %from] : !warp.array<2 x !t>, si32, si32 -> !t
    warp.store %v, %y[%i, %number] : !t, !warp.array<2 x !t>, si32, si32
  }
  return
}

// -----

// A constant place in the row needs no comparison, and elements of an even
// number of words begin at an odd number from each other.
// CHECK: llvm.mlir.global internal @{{.*}}() {addr_space = 3 {{.*}}} : !llvm.array<13312 x i8>
// CHECK-LABEL: llvm.func @fixed(
// CHECK-SAME: nvvm.kernel
// CHECK: "llvm.nvvm.activemask"
// CHECK-NOT: nvvm.shfl.sync
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-16: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-COUNT-12: llvm.load {{.*}} : !llvm.ptr<3> -> f32
!v = !warp.vec<12 x f32>
func.func @fixed(%x: !warp.array<2 x !v>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %two = warp.constant 2 : si32
  %v = warp.load %x[%i, %two] : !warp.array<2 x !v>, si32, si32 -> !v
  %l = warp.length(%v) : (!v) -> f32
  warp.store %l, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Elements that are small or of which little is used, places that differ from
// thread to thread, rows of every other index, and elements of more words than
// a warp has threads.
// CHECK-LABEL: llvm.func @apart(
// CHECK-SAME: nvvm.kernel
// CHECK-NOT: activemask
!v = !warp.vec<4 x f32>
!t = !warp.transform<f32>
!m = !warp.mat<6x6 x f32>
func.func @apart(%x: !warp.array<2 x !t>, %y: !warp.array<2 x !v>,
                 %z: !warp.array<2 x !m>, %at: !warp.array<1 x si32>,
                 %s: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %two = warp.constant 2 : si32
  %three = warp.constant 3 : si32
  %small = warp.load %y[%i, %one] : !warp.array<2 x !v>, si32, si32 -> !v
  warp.store %small, %y[%zero, %one] : !v, !warp.array<2 x !v>, si32, si32
  %v0 = warp.load %x[%i, %one] : !warp.array<2 x !t>, si32, si32 -> !t
  %a = warp.extract %v0[%two] : !t, si32 -> f32
  %b = warp.extract %v0[%three] : !t, si32 -> f32
  %ab = warp.mul(%a, %b) : (f32, f32) -> f32
  warp.store %ab, %s[%i] : f32, !warp.array<1 x f32>, si32
  %own = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %v1 = warp.load %x[%i, %own] : !warp.array<2 x !t>, si32, si32 -> !t
  warp.store %v1, %x[%zero, %one] : !t, !warp.array<2 x !t>, si32, si32
  %double = warp.mul(%i, %two) : (si32, si32) -> si32
  %v2 = warp.load %x[%double, %one] : !warp.array<2 x !t>, si32, si32 -> !t
  warp.store %v2, %x[%zero, %one] : !t, !warp.array<2 x !t>, si32, si32
  %v3 = warp.load %x[%i, %i] : !warp.array<2 x !t>, si32, si32 -> !t
  warp.store %v3, %x[%zero, %one] : !t, !warp.array<2 x !t>, si32, si32
  %large = warp.load %z[%i, %one] : !warp.array<2 x !m>, si32, si32 -> !m
  warp.store %large, %z[%zero, %one] : !m, !warp.array<2 x !m>, si32, si32
  return
}
