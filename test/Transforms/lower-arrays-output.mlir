// RUN: warp-opt %s --split-input-file --warp-lower-arrays | FileCheck %s


// Arguments are promoted as C does, and lengths in the format follow them.
// CHECK: llvm.func @warp_printf(!llvm.ptr, ...) -> i32
// CHECK: llvm.mlir.global internal constant @warp_text0("%d %lld %u %f 100%%\0A\00")
// CHECK-LABEL: llvm.func @cpu
// CHECK: %[[BYTE:.*]] = arith.extsi %{{.*}} : i8 to i32
// CHECK: %[[SHORT:.*]] = arith.extui %{{.*}} : i16 to i32
// CHECK: %[[DOUBLE:.*]] = arith.extf %{{.*}} : f32 to f64
// CHECK: %[[TEXT:.*]] = llvm.mlir.addressof @warp_text0
// CHECK: llvm.call @warp_printf(%[[TEXT]], %[[BYTE]], %{{.*}}, %[[SHORT]], %[[DOUBLE]]) vararg
llvm.func @cpu(%block: !llvm.ptr, %a: i8, %b: i64, %c: i16, %d: f32)
    attributes {warp.entry} {
  warp.printf "%d %d %u %f 100%%\0A"(%a, %b, %c, %d) : i8, i64, i16, f32
  llvm.return
}

// -----

// A conversion that does not suit its argument is replaced.
// CHECK: @warp_text0("%f %lld %5d\00")
llvm.func @unsuitable(%block: !llvm.ptr, %a: f64, %b: i64, %c: i32)
    attributes {warp.entry} {
  warp.printf "%d %s %*5n"(%a, %b, %c) : f64, i64, i32
  llvm.return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, index32 = false>

// The GPU gets a buffer.
// CHECK: llvm.func @vprintf(!llvm.ptr, !llvm.ptr) -> i32
// CHECK: llvm.mlir.global internal constant @warp_text0("%f\00") {addr_space = 1
// CHECK-LABEL: llvm.func @gpu
// CHECK: %[[BUFFER:.*]] = llvm.alloca %{{.*}} x !llvm.struct<(f64)>
// CHECK: %[[SLOT:.*]] = llvm.getelementptr %[[BUFFER]][0, 0]
// CHECK: llvm.store %{{.*}}, %[[SLOT]] : f64
// CHECK: llvm.call @vprintf(%{{.*}}, %[[BUFFER]])
llvm.func @gpu(%block: !llvm.ptr, %x: f64)
    attributes {warp.entry, warp.variant = #gpu} {
  warp.printf "%f"(%x) : f64
  llvm.return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>, index32 = false,
      debug = true>

// A debugging launch checks every access: outside, it reports the site and
// loads zero.
// CHECK: llvm.func internal @warp_report
// CHECK: llvm.atomicrmw xchg
// CHECK-LABEL: llvm.func @checked
// CHECK-SAME: warp.sites = {{\[\[}}"k.py", 7, 3, "a"], ["k.py", 9, 5, "is small"]]
// CHECK: %[[RECORD:.*]] = llvm.load %{{.*}} {alignment = 8 : i64} : !llvm.ptr -> i64
// CHECK: %[[INSIDE:.*]] = arith.cmpi ult
// CHECK: %[[VALUE:.*]] = scf.if %[[INSIDE]] -> (f32) {
// CHECK: llvm.load
// CHECK: } else {
// CHECK: llvm.call @warp_report(%[[RECORD]]
// CHECK: arith.constant 0.0
// CHECK: arith.xori
// CHECK: scf.if
// CHECK: llvm.call @warp_report
llvm.func @checked(%block: !llvm.ptr, %i: i32, %ok: i1)
    attributes {warp.entry, warp.variant = #cpu} {
  %a = warp.parameter %block[24] {name = "a"}
    : !llvm.ptr -> !warp.array<1 x f32>
  %v = warp.load_components %a[%i] : !warp.array<1 x f32>, i32 -> f32
    loc("k.py":7:3)
  warp.assert %ok, "is small" loc("k.py":9:5)
  llvm.return
}

// -----

// Otherwise nothing is checked.
// CHECK-LABEL: llvm.func @unchecked
// CHECK-NOT: warp_report
// CHECK-NOT: scf.if
// CHECK: llvm.return
llvm.func @unchecked(%block: !llvm.ptr, %i: i32, %ok: i1)
    attributes {warp.entry} {
  %a = warp.parameter %block[24] : !llvm.ptr -> !warp.array<1 x f32>
  %v = warp.load_components %a[%i] : !warp.array<1 x f32>, i32 -> f32
  warp.assert %ok, "is small"
  llvm.return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>, index32 = false>

// An error in any mode has a record there, too.
// CHECK-LABEL: llvm.func @always
// CHECK-SAME: warp.sites = {{\[\[}}"k.py", 7, 3, "slice step is zero"]]
// CHECK: llvm.call @warp_report
llvm.func @always(%block: !llvm.ptr, %p: i1)
    attributes {warp.entry, warp.variant = #cpu} {
  warp.assert %p, "slice step is zero" always loc("k.py":7:3)
  llvm.return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>, index32 = false,
      debug = true>

// An index below zero counts from the end, an offset does not.
// CHECK-LABEL: llvm.func @indices
// CHECK: %[[FROM_END:.*]] = arith.addi %[[I:.*]], %{{.*}} : i32
// CHECK: arith.select %{{.*}}, %[[FROM_END]], %[[I]]
// CHECK: arith.cmpi ult
// CHECK: llvm.call @warp_report
// CHECK-NOT: arith.select
// CHECK: llvm.call @warp_report
llvm.func @indices(%block: !llvm.ptr, %i: i32)
    attributes {warp.entry, warp.variant = #cpu} {
  warp.check_index[%i] of [3], "a vector" : i32
  warp.check_index[%i] of [3], "a tile" offsets : i32
  llvm.return
}
