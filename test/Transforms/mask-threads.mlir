// RUN: warp-opt %s --split-input-file --warp-mask-threads --warp-check-tiles \
// RUN:   | FileCheck %s

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A value that a staying thread loads by itself goes into the tile, of others
// zero; what all load at one place, all load; nothing more if none stays.
// CHECK-LABEL: func.func @returns
// CHECK: %[[ALL:.*]] = warp.load %{{.*}}[%{{.*}}#0]
// CHECK: %[[STAYS:.*]] = arith.xori
// CHECK: warp.tile_from_threads
// CHECK: warp.tile_reduce max
// CHECK: %[[ANY:.*]] = warp.gt
// CHECK: scf.if %[[ANY]] {
// CHECK-NEXT: warp.load
// CHECK-NEXT: %[[OWN:.*]] = scf.if %[[STAYS]]
// CHECK-NEXT: warp.load
// CHECK: %[[GIVEN:.*]] = scf.if %[[STAYS]]
// CHECK: warp.tile_from_threads %[[GIVEN]]
// CHECK: warp.tile_store
// CHECK-NEXT: scf.if %[[STAYS]] {
// CHECK-NEXT: warp.store
func.func @returns(%a: !warp.array<1 x f32>, %c: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %none = warp.constant 0.0 : f32
  %i:2 = warp.tid : si32, si32
  %x = warp.load %a[%i#1] : !warp.array<1 x f32>, si32 -> f32
  %y = warp.load %a[%i#0] : !warp.array<1 x f32>, si32 -> f32
  %p = warp.gt(%x, %y) : (f32, f32) -> i1
  scf.if %p {
  } else {
    %u = warp.load %c[%i#0] : !warp.array<1 x f32>, si32 -> f32
    %v = warp.load %c[%i#1] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.add(%u, %v) : (f32, f32) -> f32
    %t = warp.tile_from_threads %w : f32 -> !warp.tile<32 x f32>
    warp.tile_store %t, %a[%c0] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
    warp.store %v, %c[%i#1] : f32, !warp.array<1 x f32>, si32
  } {warp.stays = "else"}
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// A return that all threads of a block make stays a branch.
// CHECK-LABEL: func.func @uniform
// CHECK-NOT: tile_from_threads
// CHECK: scf.if
// CHECK-NOT: scf.if
func.func @uniform(%a: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %none = warp.constant 0.0 : f32
  %i:2 = warp.tid : si32, si32
  %x = warp.load %a[%i#0] : !warp.array<1 x f32>, si32 -> f32
  %p = warp.gt(%x, %none) : (f32, f32) -> i1
  scf.if %p {
  } else {
    %t = warp.tile_splat %none : f32 -> !warp.tile<32 x f32>
    warp.tile_store %t, %a[%c0] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
    warp.store %none, %a[%i#1] : f32, !warp.array<1 x f32>, si32
  } {warp.stays = "else"}
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, rank = 2>

// The absent threads of a ragged block: their number is
// not that of their index.
// CHECK-LABEL: func.func @ragged
// CHECK: warp.launch_extent 1
// CHECK: %[[NUMBER:.*]] = warp.thread_number
// CHECK: %[[OWN:.*]] = warp.cast %[[NUMBER]]
// CHECK: %[[THERE:.*]] = warp.eq(%{{.*}}, %[[OWN]])
// CHECK: scf.if %[[THERE]]
// CHECK-NEXT: warp.load
// CHECK: warp.tile_set add {{.*}} where %[[THERE]]
// CHECK: warp.tile_store
// CHECK: scf.if %[[THERE]]
// CHECK-NEXT: warp.tile_get
func.func @ragged(%a: !warp.array<2 x f32>, %b: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.variant = #gpu,
                warp.ragged} {
  %c0 = warp.constant 0 : si32
  %none = warp.constant 0.0 : f32
  %i:2 = warp.tid : si32, si32
  %x = warp.load %a[%i#0, %i#1] : !warp.array<2 x f32>, si32, si32 -> f32
  %t = warp.tile_splat %none : f32 -> !warp.tile<4 x f32>
  %u = warp.tile_set add %x, %t[%i#0] : f32, !warp.tile<4 x f32>, (si32)
  warp.tile_store %u, %b[%c0] : !warp.tile<4 x f32>, !warp.array<1 x f32>, (si32)
  %y = warp.tile_get %u[%i#1] : !warp.tile<4 x f32>, (si32) -> f32
  warp.store %y, %b[%i#1] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// Where threads say each for its own elements where these lie, those that are
// not there say nowhere, and so do indices that they pick; what they give to a
// function of elements is zero.
// CHECK-LABEL: func.func @places
// CHECK: %[[PRESENT:.*]] = warp.eq
// CHECK: %[[OWN:.*]] = scf.if %[[PRESENT]] -> (si32) {
// CHECK-NEXT: warp.load
// CHECK: %[[FACTOR:.*]] = scf.if %[[PRESENT]] -> (f32)
// CHECK: warp.tile_map(%{{.*}}, %[[FACTOR]])
// CHECK: %[[PLACE:.*]] = scf.if %[[PRESENT]] -> (si32) {
// CHECK-NEXT: scf.yield %[[OWN]]
// CHECK: warp.constant -2147483648 : si32
// CHECK: warp.tile_store %{{.*}}, %{{.*}}[%[[PLACE]]]
// CHECK: %[[INDICES:.*]] = warp.tile_map(%{{.*}}, %[[PRESENT]])
// CHECK: warp.tile_store %{{.*}}, %{{.*}}[%{{.*}}] picked %[[INDICES]]
func.func @places(%a: !warp.array<1 x si32>, %c: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.block_threads = 32 : i64, warp.ragged,
                warp.variant = #gpu} {
  %c0 = warp.constant 0 : si32
  %i = warp.tid : si32
  %p = warp.load %a[%i] : !warp.array<1 x si32>, si32 -> si32
  %x = warp.cast %i : si32 to f32
  %t = warp.tile_load %c[%c0] : !warp.array<1 x f32>, (si32) -> !warp.tile<32 x f32>
  %u = warp.tile_map(%t, %x) {
  ^bb0(%y: f32, %f: f32):
    %z = warp.mul(%y, %f) : (f32, f32) -> f32
    warp.tile_yield %z : f32
  } : (!warp.tile<32 x f32>, f32) -> !warp.tile<32 x f32>
  warp.tile_store %u, %c[%p] : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32)
  %q = warp.tile_from_threads %i : si32 -> !warp.tile<32 x si32>
  warp.tile_store %u, %c[%c0] picked %q : !warp.tile<32 x f32>, !warp.array<1 x f32>, (si32), !warp.tile<32 x si32>
  return
}
