// RUN: warp-opt %s --split-input-file --warp-form-launch --warp-apply-schedules --warp-emit-entry --warp-apply-schedules=stage=loads --mlir-print-local-scope | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, underfilled = true>

// The lane's element of the first tile is loaded before the tiles, that of the
// next tile between slab and iterations. The iterations load from the slab; the
// loop as it was goes on where the tiles end.
// CHECK-LABEL: llvm.func {{.*}}@pairs
// CHECK: %[[X:.*]] = warp.parameter %{{.*}}[24]
// CHECK: %[[LANE_INDEX:.*]] = gpu.lane_id
// CHECK: %[[LANE:.*]] = arith.index_cast %[[LANE_INDEX]] : index to i32
// CHECK: llvm.call_intrinsic "llvm.nvvm.activemask"
// CHECK: %[[TILES:.*]]:3 = scf.if
// CHECK: %[[FIRST:.*]] = arith.addi %{{.*}}, %[[LANE]]
// CHECK: warp.load_components %[[X]][%[[FIRST]]]
// CHECK: scf.for
// CHECK: llvm.nvvm.bar.warp.sync
// CHECK-COUNT-3: llvm.store
// CHECK: llvm.nvvm.bar.warp.sync
// CHECK: warp.load_components %[[X]]
// CHECK: scf.for
// CHECK-NOT: warp.load_components
// CHECK-COUNT-3: llvm.load
// CHECK: loop_annotation = #llvm.loop_annotation<unroll = <count = 8 : i32>>
// CHECK: } else {
// CHECK: scf.for %[[J:.*]] = %{{.*}} iter_args(%{{.*}} = %[[TILES]]#0, %{{.*}} = %[[TILES]]#1, %{{.*}} = %[[TILES]]#2)
// CHECK: warp.load_components %[[X]][%[[J]]]
func.func @pairs(%x: !warp.array<1 x !warp.vec<3 x f32>>,
                 %y: !warp.array<1 x !warp.vec<3 x f32>>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %s:3 = scf.for %j = %c0 to %n step %c1
      iter_args(%a = %zero, %b = %zero, %c = %zero) -> (f32, f32, f32) : i32 {
    %v:3 = warp.load_components %x[%j]
      : !warp.array<1 x !warp.vec<3 x f32>>, i32 -> f32, f32, f32
    %d = arith.addf %a, %v#0 : f32
    %e = arith.addf %b, %v#1 : f32
    %f = arith.addf %c, %v#2 : f32
    scf.yield %d, %e, %f : f32, f32, f32
  }
  warp.store_components(%s#0, %s#1, %s#2), %y[%i]
    : (f32, f32, f32), !warp.array<1 x !warp.vec<3 x f32>>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, underfilled = true>

// Not where lanes load different elements, begin at different iterations, or
// where the loop writes.
// CHECK-LABEL: llvm.func {{.*}}@unsuited
// CHECK-NOT: activemask
func.func @unsuited(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %zero = arith.constant 0.0 : f32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %a = scf.for %j = %c0 to %n step %c1 iter_args(%s = %zero) -> f32 : i32 {
    %k = arith.addi %i, %j : i32
    %v = warp.load_components %x[%k] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  %b = scf.for %j = %i to %n step %c1 iter_args(%s = %a) -> f32 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %s, %v : f32
    scf.yield %t : f32
  }
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %b, %v : f32
    warp.store_components(%t), %y[%j] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, underfilled = true>

// Also where the loop carries nothing.
// CHECK-LABEL: llvm.func {{.*}}@nothing_carried
// CHECK: %[[AHEAD:.*]] = warp.load_components
// CHECK: scf.for {{.*}} iter_args(%{{.*}} = %[[AHEAD]]) -> (f32)
func.func @nothing_carried(%x: !warp.array<1 x f32>, %n: i32)
    attributes {warp.kernel, warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  scf.for %j = %c0 to %n step %c1 : i32 {
    %v = warp.load_components %x[%j] : !warp.array<1 x f32>, i32 -> f32
  }
  return
}
