// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=2" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=64" | FileCheck %s --check-prefix=MANY
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm threads=2 debug" | FileCheck %s --check-prefix=DEBUG

// Much is computed for one update: the loop over threads leaves values and
// indices in buffers, and a second loop adds them.
// CHECK: #[[THREADS:.*]] = #llvm.loop_annotation<{{.*}}parallelAccesses = #[[GROUP:.*]]>
// CHECK-LABEL: llvm.func @polynomial
// CHECK-SAME: #warp.recipe<{{.*}}exclusive = true
// CHECK-DAG: %[[VALUES:.*]] = llvm.alloca %{{.*}} x f32
// CHECK-DAG: %[[PLACES:.*]] = llvm.alloca %{{.*}} x i32
// CHECK: llvm.intr.smin
// CHECK: llvm.load {{.*}}access_groups = [#[[GROUP]]]
// CHECK: llvm.store %{{.*}} {access_groups = [#[[GROUP]]]} : f32
// CHECK: llvm.cond_br {{.*}}loop_annotation = #[[THREADS]]
// CHECK: %[[VALUE:.*]] = llvm.load %{{.*}} : !llvm.ptr -> f32
// CHECK: llvm.load %{{.*}} : !llvm.ptr -> i32
// CHECK: %[[OLD:.*]] = llvm.load %{{.*}} {alignment = 4 : i64} : !llvm.ptr -> f32
// CHECK: %[[NEW:.*]] = llvm.fadd %[[OLD]], %[[VALUE]]
// CHECK: llvm.store %[[NEW]]
// With many threads atomic updates are faster, and a check names its thread.
// MANY-LABEL: llvm.func @polynomial
// MANY-NOT: llvm.alloca
// MANY: llvm.atomicrmw fadd
// DEBUG-LABEL: llvm.func @polynomial
// DEBUG-NOT: llvm.alloca %{{.*}} x f32
// DEBUG: llvm.return
func.func @polynomial(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>,
                      %sum: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %b = warp.mul(%a, %a) : (f32, f32) -> f32
  %c = warp.add(%b, %a) : (f32, f32) -> f32
  %d = warp.mul(%c, %b) : (f32, f32) -> f32
  %e = warp.add(%d, %a) : (f32, f32) -> f32
  %f = warp.mul(%e, %c) : (f32, f32) -> f32
  %g = warp.add(%f, %b) : (f32, f32) -> f32
  %h = warp.mul(%g, %e) : (f32, f32) -> f32
  %v = warp.add(%h, %d) : (f32, f32) -> f32
  %old = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// A histogram computes nothing.
// CHECK-LABEL: llvm.func @histogram
// CHECK-SAME: #warp.recipe<{{.*}}exclusive = true
// CHECK-NOT: llvm.alloca
// CHECK: llvm.return
func.func @histogram(%at: !warp.array<1 x si32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %one = warp.constant 1.0 : f32
  %old = warp.atomic add %one, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// What is updated is read, too: a thread must see the updates before it.
// CHECK-LABEL: llvm.func @read_back
// CHECK-NOT: llvm.alloca
// CHECK: llvm.return
func.func @read_back(%at: !warp.array<1 x si32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %j = warp.load %at[%i] : !warp.array<1 x si32>, si32 -> si32
  %a = warp.load %sum[%i] : !warp.array<1 x f32>, si32 -> f32
  %b = warp.mul(%a, %a) : (f32, f32) -> f32
  %c = warp.add(%b, %a) : (f32, f32) -> f32
  %d = warp.mul(%c, %b) : (f32, f32) -> f32
  %e = warp.add(%d, %a) : (f32, f32) -> f32
  %f = warp.mul(%e, %c) : (f32, f32) -> f32
  %g = warp.add(%f, %b) : (f32, f32) -> f32
  %h = warp.mul(%g, %e) : (f32, f32) -> f32
  %v = warp.add(%h, %d) : (f32, f32) -> f32
  %old = warp.atomic add %v, %sum[%j]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}
