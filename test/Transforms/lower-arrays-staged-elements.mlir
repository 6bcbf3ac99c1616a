// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=255 non-negative=255" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 rank=2 packed=255 non-negative=255 skinny" | FileCheck %s --check-prefix=GRID
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90" | FileCheck %s --check-prefix=NONE
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=255 non-negative=255 debug" | FileCheck %s --check-prefix=NONE
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90 packed=255 non-negative=255 block-dim=1024" | FileCheck %s --check-prefix=BLOCK
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=cpu packed=255 non-negative=255" | FileCheck %s --check-prefix=NONE

// Arrays that may have gaps, a launch for debugging, the CPU: each thread
// accesses its own element.
// NONE-NOT: activemask

// A whole warp loads neighbouring words, a line apart in one thread, and
// exchanges them in its slab; so it stores. Threads of a warp that lacks some
// load their own elements, but share the words that they store and wait for
// each other alone; few threads store their own.
// CHECK: llvm.mlir.global internal @{{.*}}() {addr_space = 3 {{.*}}} : !llvm.array<9216 x i8>
// CHECK-LABEL: llvm.func @both(
// CHECK-SAME: nvvm.kernel
// CHECK: %[[MASK:.*]] = llvm.call_intrinsic "llvm.nvvm.activemask"
// CHECK: %[[WHOLE:.*]] = llvm.icmp "eq" %[[MASK]]
// CHECK: llvm.cond_br %[[WHOLE]]
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK: %[[SHARE:.*]] = llvm.getelementptr {{.*}} -> !llvm.ptr<1>, f32
// CHECK: llvm.getelementptr inbounds %[[SHARE]][32] : (!llvm.ptr<1>) -> !llvm.ptr<1>, f32
// CHECK: llvm.getelementptr inbounds %[[SHARE]][256] : (!llvm.ptr<1>) -> !llvm.ptr<1>, f32
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-9: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK: llvm.br
// CHECK-COUNT-9: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-NOT: activemask
// CHECK: llvm.cond_br %[[WHOLE]]
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK: %[[NOW:.*]] = llvm.call_intrinsic "llvm.nvvm.activemask"
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"(%[[NOW]])
// CHECK-COUNT-4: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK: "llvm.nvvm.bar.warp.sync"(%[[NOW]])
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<1>
// CHECK-NOT: llvm.store
!m = !warp.mat<3x3 x f32>
func.func @both(%x: !warp.array<1 x !m>, %y: !warp.array<1 x !m>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !m>, si32 -> !m
  %n = warp.neg(%v) : (!m) -> !m
  warp.store %n, %y[%i] : !m, !warp.array<1 x !m>, si32
  return
}

// -----

// Loads with nothing but arithmetic between them are all on their way before
// the first exchange, those of smaller elements, too. It does not matter which
// thread stores a zero.
// CHECK-LABEL: llvm.func @together(
// CHECK-SAME: nvvm.kernel
// CHECK-COUNT-3: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK: "llvm.nvvm.activemask"
// CHECK: llvm.cond_br %[[WHOLE:[0-9]+]],
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-18: llvm.load {{.*}} : !llvm.ptr<1> -> f32
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-9: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-9: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-COUNT-9: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// CHECK: llvm.cond_br %[[WHOLE]]
// CHECK: "llvm.nvvm.bar.warp.sync"
// CHECK-NOT: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK-COUNT-9: llvm.store %{{.*}} : f32, !llvm.ptr<1>
// CHECK: "llvm.nvvm.bar.warp.sync"
!m = !warp.mat<3x3 x f32>
!v = !warp.vec<3 x f32>
func.func @together(%x: !warp.array<1 x !m>, %y: !warp.array<1 x !m>,
                    %z: !warp.array<1 x !v>, %s: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0.0 : f32
  %none = warp.construct(%zero, %zero, %zero, %zero, %zero, %zero, %zero, %zero,
                         %zero) : (f32, f32, f32, f32, f32, f32, f32, f32, f32) -> !m
  %a = warp.load %x[%i] : !warp.array<1 x !m>, si32 -> !m
  %d = warp.determinant(%a) : (!m) -> f32
  %b = warp.load %y[%i] : !warp.array<1 x !m>, si32 -> !m
  %c = warp.load %z[%i] : !warp.array<1 x !v>, si32 -> !v
  warp.store %none, %y[%i] : !m, !warp.array<1 x !m>, si32
  %e = warp.determinant(%b) : (!m) -> f32
  %l = warp.length(%c) : (!v) -> f32
  %de = warp.mul(%d, %e) : (f32, f32) -> f32
  %r = warp.mul(%de, %l) : (f32, f32) -> f32
  warp.store %r, %s[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Sixteen words would begin at two banks; a word of padding per 32 keeps the
// elements of a warp apart, and a slot has seventeen. There is no memory for 32
// warps.
// BLOCK-LABEL: llvm.func @padded(
// BLOCK-SAME: nvvm.kernel
// BLOCK-NOT: activemask
// BLOCK: llvm.return
// CHECK: llvm.mlir.global internal @{{.*}}() {addr_space = 3 {{.*}}} : !llvm.array<17408 x i8>
// CHECK-LABEL: llvm.func @padded(
// CHECK-SAME: nvvm.kernel
// CHECK: %[[SLOT:.*]] = llvm.getelementptr {{.*}} -> !llvm.ptr<3>, f32
// CHECK: llvm.getelementptr inbounds %[[SLOT]][33] : (!llvm.ptr<3>) -> !llvm.ptr<3>, f32
// CHECK: llvm.getelementptr inbounds %[[SLOT]][495] : (!llvm.ptr<3>) -> !llvm.ptr<3>, f32
!m = !warp.mat<4x4 x f32>
func.func @padded(%x: !warp.array<1 x !m>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !m>, si32 -> !m
  %t = warp.determinant(%v) : (!m) -> f32
  warp.store %t, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Sums over the block have 16 kB of the shared memory, so the slabs of 36-word
// elements do not fit.
// CHECK-LABEL: llvm.func @full(
// CHECK-SAME: nvvm.kernel
// CHECK-NOT: activemask
// CHECK: llvm.return
!m = !warp.mat<6x6 x f32>
!l = !warp.mat<8x8 x f64>
func.func @full(%x: !warp.array<1 x !m>, %y: !warp.array<1 x !l>,
                %sum: !warp.array<1 x !l>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x !m>, si32 -> !m
  warp.store %v, %x[%zero] : !m, !warp.array<1 x !m>, si32
  %l = warp.load %y[%zero] : !warp.array<1 x !l>, si32 -> !l
  %old0 = warp.atomic add %l, %sum[%zero]
    : !l, !warp.array<1 x !l>, si32 -> !l
  %one = warp.constant 1 : si32
  %old1 = warp.atomic add %l, %sum[%one]
    : !l, !warp.array<1 x !l>, si32 -> !l
  %two = warp.constant 2 : si32
  %old2 = warp.atomic add %l, %sum[%two]
    : !l, !warp.array<1 x !l>, si32 -> !l
  %three = warp.constant 3 : si32
  %old3 = warp.atomic add %l, %sum[%three]
    : !l, !warp.array<1 x !l>, si32 -> !l
  return
}

// -----

// Threads of a row follow each other along the last dimension, if warps do not
// hold parts of several rows; elsewhere they compare addresses, those that are
// there where some are missing.
// GRID-LABEL: llvm.func @rows(
// GRID-SAME: nvvm.kernel
// GRID: %[[WIDTH:.*]] = nvvm.read.ptx.sreg.ntid.x
// GRID: %[[REST:.*]] = llvm.and %{{.*}}, %{{.*}} : i32
// GRID: %[[ROW:.*]] = llvm.icmp "eq" %[[REST]]
// GRID: %[[ALL:.*]] = llvm.icmp "eq"
// GRID: %[[KNOWN:.*]] = llvm.and %[[ALL]], %[[ROW]] : i1
// GRID: llvm.cond_br %[[KNOWN]]
// GRID: nvvm.shfl.sync
// GRID: "llvm.nvvm.vote.all.sync"
// GRID-COUNT-3: "llvm.nvvm.bar.warp.sync"
// GRID: "llvm.nvvm.vote.all.sync"
// GRID-COUNT-3: "llvm.nvvm.bar.warp.sync"
// GRID: %[[HERE:.*]] = llvm.call_intrinsic "llvm.nvvm.activemask"
// GRID: "llvm.nvvm.match.all.sync.i64p"(%[[HERE]],
// GRID-COUNT-2: "llvm.nvvm.bar.warp.sync"(%[[HERE]])
// GRID-NOT: "llvm.nvvm.bar.warp.sync"
!m = !warp.mat<3x3 x f32>
func.func @rows(%x: !warp.array<2 x !m>, %y: !warp.array<2 x !m>)
    attributes {warp.kernel} {
  %i, %j = warp.tid : si32, si32
  %v = warp.load %x[%i, %j] : !warp.array<2 x !m>, si32, si32 -> !m
  warp.store %v, %y[%i, %j] : !m, !warp.array<2 x !m>, si32, si32
  return
}

// -----

// Elsewhere threads may be missing, so the question is asked again.
// CHECK-LABEL: llvm.func @branch(
// CHECK-SAME: nvvm.kernel
// CHECK: "llvm.nvvm.activemask"
// CHECK: llvm.store {{.*}} : f32, !llvm.ptr<3>
// CHECK: "llvm.nvvm.activemask"
// CHECK: llvm.store {{.*}} : f32, !llvm.ptr<3>
!m = !warp.mat<3x3 x f32>
func.func @branch(%x: !warp.array<1 x !m>, %n: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !m>, si32 -> !m
  %d = warp.determinant(%v) : (!m) -> f32
  %zero = warp.constant 0.0 : f32
  %positive = warp.gt(%d, %zero) : (f32, f32) -> i1
  scf.if %positive {
    %n0 = warp.neg(%v) : (!m) -> !m
    warp.store %n0, %x[%i] : !m, !warp.array<1 x !m>, si32
  }
  return
}

// -----

// Elements that are small or of which little is used; those that do not follow
// each other: strided, reversed, looked up, perhaps counted from the end; and
// those that a loop accesses again.
// CHECK-LABEL: llvm.func @apart(
// CHECK-SAME: nvvm.kernel
// CHECK-NOT: activemask
!m = !warp.mat<3x3 x f32>
!v = !warp.vec<4 x f32>
func.func @apart(%x: !warp.array<1 x !m>, %y: !warp.array<1 x !v>,
                 %at: !warp.array<1 x si32>, %n: si32)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %small = warp.load %y[%i] : !warp.array<1 x !v>, si32 -> !v
  warp.store %small, %y[%i] : !v, !warp.array<1 x !v>, si32
  %whole = warp.load %x[%i] : !warp.array<1 x !m>, si32 -> !m
  %trace = warp.trace(%whole) : (!m) -> f32
  %one = warp.constant 1 : si32
  %scaled = warp.mul(%small, %trace) : (!v, f32) -> !v
  warp.store %scaled, %y[%i] : !v, !warp.array<1 x !v>, si32
  %two = warp.constant 2 : si32
  %double = warp.mul(%i, %two) : (si32, si32) -> si32
  %v0 = warp.load %x[%double] : !warp.array<1 x !m>, si32 -> !m
  warp.store %v0, %x[%one] : !m, !warp.array<1 x !m>, si32
  %reversed = warp.sub(%n, %i) : (si32, si32) -> si32
  %v1 = warp.load %x[%reversed] : !warp.array<1 x !m>, si32 -> !m
  warp.store %v1, %x[%one] : !m, !warp.array<1 x !m>, si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %sum = warp.add(%i, %j) : (si32, si32) -> si32
  %v2 = warp.load %x[%sum] : !warp.array<1 x !m>, si32 -> !m
  warp.store %v2, %x[%one] : !m, !warp.array<1 x !m>, si32
  %before = warp.sub(%i, %one) : (si32, si32) -> si32
  %v3 = warp.load %x[%before] : !warp.array<1 x !m>, si32 -> !m
  warp.store %v3, %x[%one] : !m, !warp.array<1 x !m>, si32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c4 = arith.constant 4 : i32
  scf.for %k = %c0 to %c4 step %c1 : i32 {
    %number = warp.cast %k : i32 to si32
    %at_k = warp.add(%i, %number) : (si32, si32) -> si32
    %v4 = warp.load %x[%at_k] : !warp.array<1 x !m>, si32 -> !m
    warp.store %v4, %x[%i] : !m, !warp.array<1 x !m>, si32
  }
  return
}
