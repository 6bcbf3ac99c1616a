// RUN: warp-opt %s --split-input-file --warp-place-tiles | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A loop that ends early carries sums in registers, also through the branch that
// ends it, and begins by taking them from the memory that a view is of.
// CHECK-LABEL: func.func @sums
// CHECK: %[[M:.*]] = warp.tile_load %arg2
// CHECK: %[[V:.*]] = warp.tile_reshape %[[M]] {{.*}}storage = inlined
// CHECK-NEXT: %[[T:.*]] = warp.tile_map(%[[V]])
// CHECK: storage = accumulators
// CHECK: %[[R:.*]]:3 = scf.while (%{{[^,]*}}, %[[B:arg[0-9]+]] = %[[T]],
// CHECK-NOT: warp.tile_map
// CHECK: scf.condition(%{{.*}}) %{{.*}}, %[[B]]
// CHECK: ^bb0(%{{[^,]*}}, %[[A:[^:]*]]: !warp.tile<32x32 x f32>, %{{.*}}):
// CHECK: %[[I:.*]]:2 = scf.if
// CHECK: scf.yield %[[A]]
// CHECK: %[[N:.*]] = warp.tile_matmul {{.*}} add %[[A]] {{.*}}in_place = 2{{.*}}storage = accumulators
// CHECK: scf.yield %[[N]]
// CHECK-NOT: warp.tile_map
// CHECK: scf.yield %{{.*}}, %[[I]]#0
// CHECK: warp.tile_store %[[R]]#1
func.func @sums(%a: !warp.array<2 x f32>, %c: !warp.array<2 x f32>,
                %m: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel, warp.block_threads = 64 : i64,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %c16 = warp.constant 16 : si32
  %true = warp.constant true
  %false = warp.constant false
  %flat = warp.tile_load %m[%c0] : !warp.array<1 x f32>, (si32)
    -> !warp.tile<1024 x f32>
  %init = warp.tile_reshape %flat : !warp.tile<1024 x f32> -> !warp.tile<32x32 x f32>
  %r:3 = scf.while (%k = %c0, %s = %init, %done = %false)
      : (si32, !warp.tile<32x32 x f32>, i1) -> (si32, !warp.tile<32x32 x f32>, i1) {
    %less = warp.lt(%k, %c16) : (si32, si32) -> i1
    %open = warp.unot(%done) : (i1) -> i1
    %go = warp.bit_and(%less, %open) : (i1, i1) -> i1
    scf.condition(%go) %k, %s, %done : si32, !warp.tile<32x32 x f32>, i1
  } do {
  ^bb0(%k: si32, %s: !warp.tile<32x32 x f32>, %done: i1):
    %ends = warp.ge(%k, %n) : (si32, si32) -> i1
    %next:2 = scf.if %ends -> (!warp.tile<32x32 x f32>, i1) {
      scf.yield %s, %true : !warp.tile<32x32 x f32>, i1
    } else {
      %x = warp.tile_load %a[%k, %c0] : !warp.array<2 x f32>, (si32, si32)
        -> !warp.tile<32x16 x f32>
      %y = warp.tile_load %a[%c0, %k] : !warp.array<2 x f32>, (si32, si32)
        -> !warp.tile<16x32 x f32>
      %t = warp.tile_matmul %x, %y add %s : !warp.tile<32x16 x f32>,
        !warp.tile<16x32 x f32> add !warp.tile<32x32 x f32>
        -> !warp.tile<32x32 x f32>
      scf.yield %t, %done : !warp.tile<32x32 x f32>, i1
    }
    %k1 = warp.add(%k, %c1) : (si32, si32) -> si32
    scf.yield %k1, %next#0, %next#1 : si32, !warp.tile<32x32 x f32>, i1
  }
  warp.tile_store %r#1, %c[%c0, %c0] : !warp.tile<32x32 x f32>,
    !warp.array<2 x f32>, (si32, si32)
  return
}

// -----

// Tiles that a loop exchanges are copied at its end alone, both before either is
// overwritten.
// CHECK-LABEL: func.func @exchanged
// CHECK: scf.condition(%{{.*}}) %{{.*}}, %{{.*}}, %{{.*}} :
// CHECK: ^bb0(%{{.*}}: si32, %[[X:.*]]: !warp.tile<8 x f32>, %[[Y:.*]]: !warp.tile<8 x f32>):
// CHECK: %[[P:.*]] = warp.tile_map(%[[Y]])
// CHECK: %[[Q:.*]] = warp.tile_map(%[[X]])
// CHECK: %[[INX:.*]] = warp.tile_map(%[[P]], %[[X]])
// CHECK: in_place = 1
// CHECK: %[[INY:.*]] = warp.tile_map(%[[Q]], %[[Y]])
// CHECK: in_place = 1
// CHECK: scf.yield %{{.*}}, %[[INX]], %[[INY]]
func.func @exchanged(%a: !warp.array<1 x f32>, %n: si32)
    attributes {warp.kernel, warp.block_threads = 32 : i64} {
  %c0 = warp.constant 0 : si32
  %c1 = warp.constant 1 : si32
  %c8 = warp.constant 8 : si32
  %u = warp.tile_load %a[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<8 x f32>
  %v = warp.tile_load %a[%c8] : !warp.array<1 x f32>, (si32) -> !warp.tile<8 x f32>
  %r:3 = scf.while (%k = %c0, %x = %u, %y = %v)
      : (si32, !warp.tile<8 x f32>, !warp.tile<8 x f32>)
      -> (si32, !warp.tile<8 x f32>, !warp.tile<8 x f32>) {
    %less = warp.lt(%k, %n) : (si32, si32) -> i1
    scf.condition(%less) %k, %x, %y : si32, !warp.tile<8 x f32>, !warp.tile<8 x f32>
  } do {
  ^bb0(%k: si32, %x: !warp.tile<8 x f32>, %y: !warp.tile<8 x f32>):
    %k1 = warp.add(%k, %c1) : (si32, si32) -> si32
    scf.yield %k1, %y, %x : si32, !warp.tile<8 x f32>, !warp.tile<8 x f32>
  }
  warp.tile_store %r#1, %a[%c0] : !warp.tile<8 x f32>, !warp.array<1 x f32>, (si32)
  warp.tile_store %r#2, %a[%c8] : !warp.tile<8 x f32>, !warp.array<1 x f32>, (si32)
  return
}
