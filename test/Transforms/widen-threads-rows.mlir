// RUN: warp-opt %s --warp-form-launch --warp-widen-threads --split-input-file \
// RUN:   | FileCheck %s

#any = #warp.variant<target = <name = "cpu", bits = 512>, rank = 2, packed = 1>

// Rows of any length have the lanes of vectors; what the code is for depends on
// the length.
// CHECK-LABEL: func.func @any_row
// CHECK-SAME: size_facts = 8
// CHECK-SAME: lanes = 32
func.func @any_row(%x: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.variant = #any} {
  %i, %j = warp.tid : i32, i32
  %v = warp.load_components %x[%i, %j] : !warp.array<2 x f32>, i32, i32 -> f32
  %a = math.sin %v : f32
  %b = math.exp %a : f32
  %c = math.log %b : f32
  warp.store_components(%c), %x[%i, %j] : (f32), !warp.array<2 x f32>, i32, i32
  return
}

// -----

#short = #warp.variant<target = <name = "cpu", bits = 512>, rank = 2, packed = 1, inner_extent = 4>

// More than four lanes would have nothing to do in rows of up to four.
// CHECK-LABEL: func.func @short_row
// CHECK-SAME: lanes = 4
func.func @short_row(%x: !warp.array<2 x f32>)
    attributes {warp.kernel, warp.variant = #short} {
  %i, %j = warp.tid : i32, i32
  %v = warp.load_components %x[%i, %j] : !warp.array<2 x f32>, i32, i32 -> f32
  %a = math.sin %v : f32
  %b = math.exp %a : f32
  %c = math.log %b : f32
  warp.store_components(%c), %x[%i, %j] : (f32), !warp.array<2 x f32>, i32, i32
  return
}

// -----

#short = #warp.variant<target = <name = "cpu", bits = 512>, rank = 2, inner_extent = 4>

// Four lanes that gather gain less than sixteen.
// CHECK-LABEL: func.func @short_gather
// CHECK-SAME: size_facts = 8
// CHECK-NOT: lanes = {{[0-9]}}
func.func @short_gather(%at: !warp.array<1 x si32>, %x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.variant = #short} {
  %i, %j = warp.tid : i32, i32
  %k = warp.load_components %at[%j] : !warp.array<1 x si32>, i32 -> i32
  %v = warp.load_components %x[%k] : !warp.array<1 x f32>, i32 -> f32
  %a = arith.mulf %v, %v : f32
  %b = arith.addf %a, %v : f32
  %c = math.sqrt %b : f32
  %d = arith.divf %c, %a : f32
  warp.store_components(%d), %x[%k] : (f32), !warp.array<1 x f32>, i32
  return
}
