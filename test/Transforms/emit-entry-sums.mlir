// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm" | FileCheck %s
// RUN: warp-opt %s --split-input-file --warp-pipeline="to-llvm target=sm_90" | FileCheck %s --check-prefix=GPU

// A sum into one element is a value per lane that the loop over threads
// carries; halves are added at its end, and published by one atomic operation.
// No thread can miss the update, so a GPU block asks nobody.
// CHECK-LABEL: llvm.func @one_address
// CHECK: ^[[LOOP:bb[0-9]+]](%{{.*}}: i64, %[[SUM:.*]]: vector<[[LANES:[0-9]+]]xf32>):
// CHECK: %[[NEXT:.*]] = llvm.fadd %[[SUM]], %{{.*}} {fastmathFlags = #llvm.fastmath<reassoc>} : vector<[[LANES]]xf32>
// CHECK: llvm.br ^[[LOOP]](%{{.*}}, %[[NEXT]] : i64, vector<[[LANES]]xf32>)
// CHECK-NOT: atomicrmw
// CHECK: llvm.fadd %{{.*}} : vector<2xf32>
// CHECK: llvm.fadd %{{.*}} : vector<1xf32>
// CHECK: %[[TOTAL:.*]] = llvm.extractelement
// CHECK: llvm.atomicrmw fadd {{.*}}, %[[TOTAL]] monotonic
// CHECK-NOT: atomicrmw
// CHECK: llvm.return
// GPU-LABEL: llvm.func @one_address(
// GPU-SAME: nvvm.kernel
// GPU-NOT: barrier.cta.red
// GPU: nvvm.shfl.sync down
// GPU: nvvm.barrier0
// GPU: llvm.atomicrmw fadd {{.*}} syncscope("device") monotonic
// GPU: llvm.return
func.func @one_address(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %zero = warp.constant 0 : si32
  %old = warp.atomic add %v, %sum[%zero]
    : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// Threads that do not come to the update add nothing; the array is touched if
// one of the group did.
// CHECK-LABEL: llvm.func @guarded
// CHECK: ^[[LOOP:bb[0-9]+]](%{{.*}}: i64, %{{.*}}: vector<[[LANES:[0-9]+]]xf32>, %[[ANY:.*]]: vector<[[LANES]]xi1>):
// CHECK: llvm.or %[[ANY]], %{{.*}} : vector<[[LANES]]xi1>
// CHECK: %[[CAME:.*]] = llvm.extractelement %{{.*}} : vector<1xi1>
// CHECK: llvm.cond_br %[[CAME]]
// CHECK: llvm.atomicrmw fadd
// CHECK: llvm.return
// GPU-LABEL: llvm.func @guarded(
// GPU-SAME: nvvm.kernel
// GPU: "llvm.nvvm.barrier.cta.red.or.aligned.all"
// GPU: llvm.atomicrmw fadd
// GPU: llvm.return
func.func @guarded(%x: !warp.array<1 x f32>, %sum: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %zero = warp.constant 0 : si32
  %none = warp.constant 0.0 : f32
  %is_positive = warp.gt(%v, %none) : (f32, f32) -> i1
  scf.if %is_positive {
    %old = warp.atomic add %v, %sum[%zero]
      : f32, !warp.array<1 x f32>, si32 -> f32
  }
  return
}

// -----

// Gradients are summed with 64 bits.
// CHECK-LABEL: llvm.func @one_gradient
// CHECK: ^bb{{[0-9]+}}(%{{.*}}: i64, %[[SUM:.*]]: vector<{{[0-9]+}}xf64>):
// CHECK: llvm.fpext {{.*}} : vector<{{[0-9]+}}xf32> to vector<{{[0-9]+}}xf64>
// CHECK: llvm.fadd %[[SUM]], {{.*}} {fastmathFlags = #llvm.fastmath<reassoc>} : vector<{{[0-9]+}}xf64>
// CHECK: llvm.fptrunc {{.*}} : f64 to f32
// CHECK: llvm.atomicrmw fadd {{.*}}, f32
// GPU-LABEL: llvm.func @one_gradient(
// GPU-SAME: nvvm.kernel
// GPU: llvm.fpext {{.*}} : f32 to f64
// GPU-COUNT-2: nvvm.shfl.sync down
// GPU: llvm.fptrunc {{.*}} : f64 to f32
// GPU: llvm.atomicrmw fadd {{.*}}, f32
func.func @one_gradient(%x: !warp.array<1 x f32>, %p: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %zero = warp.constant 0 : si32
  %g = warp.grad %p : !warp.array<1 x f32> -> !warp.array<1 x f32>
  warp.accumulate %v, %g[%zero] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// Three values of each thread: halves of a warp hand each other values, 2 + 1
// of them, before lanes with the same one combine theirs; then a thread per value
// combines what the warps have left, and the first one publishes the totals.
// GPU-LABEL: llvm.func @vectors(
// GPU-NOT: nvvm.shfl.sync down
// GPU-COUNT-6: nvvm.shfl.sync bfly
// GPU-NOT: nvvm.shfl.sync
// GPU: llvm.store {{.*}} : f32, !llvm.ptr<3>
// GPU: nvvm.barrier0
// GPU: llvm.store {{.*}} : f32, !llvm.ptr<3>
// GPU: nvvm.barrier0
// GPU-COUNT-3: llvm.load {{.*}} : !llvm.ptr<3> -> f32
// GPU: llvm.atomicrmw fadd
// GPU: red.global.add.v2.f32
// GPU: llvm.return
// CHECK-LABEL: llvm.func @vectors(
func.func @vectors(%x: !warp.array<1 x !warp.vec<3 x f32>>,
                   %sum: !warp.array<1 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %zero = warp.constant 0 : si32
  %old = warp.atomic add %v, %sum[%zero]
    : !warp.vec<3 x f32>, !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  return
}
