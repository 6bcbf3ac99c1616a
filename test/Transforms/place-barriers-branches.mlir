// RUN: warp-opt %s --split-input-file --warp-place-barriers | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// Branches of tiles in registers have nothing to wait for, however deep.
// CHECK-LABEL: func.func @registers
// CHECK-NOT: warp.barrier
// CHECK: return
func.func @registers(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>,
                     %c: i1, %d: i1)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  scf.if %c {
    scf.if %d {
      %t = warp.tile_load %a[%c0] {warp.layout = #warp.tile_layout<storage = inlined>} : !warp.array<1 x f32>, (si32) -> !warp.tile<64 x f32>
      warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
    }
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// A store in a branch is waited for behind it, once, by the access that meets
// it; a branch that stores elsewhere does not wait.
// CHECK-LABEL: func.func @behind
// CHECK: scf.if
// CHECK-NEXT: warp.tile_store %{{.*}}, %arg0
// CHECK-NEXT: }
// CHECK-NEXT: scf.if
// CHECK-NEXT: warp.tile_store %{{.*}}, %arg1
// CHECK-NEXT: } else {
// CHECK-NEXT: warp.barrier
// CHECK-NEXT: warp.tile_store %{{.*}}, %arg0
// CHECK-NEXT: }
// CHECK-NEXT: warp.barrier
// CHECK-NEXT: warp.tile_store %{{.*}}, %arg0
func.func @behind(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>,
                  %c: i1, %d: i1)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %c2 = warp.constant 2 : si32
  %one = warp.constant 1.0 : f32
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<64 x f32>
  scf.if %c {
    warp.tile_store %t, %a[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  }
  scf.if %d {
    warp.tile_store %t, %b[%c0] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  } else {
    warp.tile_store %t, %a[%c1] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  }
  warp.tile_store %t, %a[%c2] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, disjoint = true>

// The next turn of a loop may meet what this one has touched.
// CHECK-LABEL: func.func @turns
// CHECK-NOT: warp.barrier
// CHECK: scf.for
// CHECK-NOT: warp.barrier
// CHECK: warp.tile_store
// CHECK-NEXT: warp.barrier
// CHECK-NEXT: }
// CHECK-NEXT: return
func.func @turns(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64,
                warp.variant = #gpu} {
  %one = warp.constant 1.0 : f32
  %t = warp.tile_splat %one {warp.layout = #warp.tile_layout<storage = inlined>} : f32 -> !warp.tile<64 x f32>
  %first = arith.constant 0 : i32
  %last = arith.constant 5 : i32
  %step = arith.constant 1 : i32
  scf.for %k = %first to %last step %step : i32 {
    %i = builtin.unrealized_conversion_cast %k : i32 to si32
    warp.tile_store %t, %a[%i] : !warp.tile<64 x f32>, !warp.array<1 x f32>, (si32)
  }
  return
}
