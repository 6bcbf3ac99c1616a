// RUN: warp-opt %s --split-input-file --warp-print-variance -o /dev/null \
// RUN:   | FileCheck %s

// An array that the kernel does not write: what is loaded depends on the
// indices, and is never linear.
// CHECK-LABEL: variance of @read_only
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = warp.load_components: uniform over the launch
// CHECK-NEXT: = warp.load_components: varies
// CHECK-NEXT: = warp.dim: uniform over the launch
func.func @read_only(%x: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel} {
  %i = warp.tid : i32
  %a = warp.load_components %x[%n] : !warp.array<1 x si32>, i32 -> i32
  %b = warp.load_components %x[%i] : !warp.array<1 x si32>, i32 -> i32
  %d = warp.dim %x, 0 : !warp.array<1 x si32> -> i32
  return
}

// -----

// An element of an array that is written has another value at another moment:
// lanes, which load it together, agree, threads elsewhere may not.
// CHECK-LABEL: variance of @written
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = warp.load_components: uniform over lanes
// CHECK-NEXT: = warp.load_components: varies
func.func @written(%x: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel} {
  %i = warp.tid : i32
  %a = warp.load_components %x[%n] : !warp.array<1 x si32>, i32 -> i32
  %b = warp.load_components %x[%i] : !warp.array<1 x si32>, i32 -> i32
  warp.store_components(%b), %x[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

// It may be written under another name.
// CHECK-LABEL: variance of @overlapping
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = warp.load_components: uniform over lanes
func.func @overlapping(%x: !warp.array<1 x si32>, %y: !warp.array<1 x si32>,
                       %n: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %a = warp.load_components %x[%n] : !warp.array<1 x si32>, i32 -> i32
  warp.store_components(%a), %y[%i] : (i32), !warp.array<1 x si32>, i32
  return
}

// -----

// Only its thread knows the result of an update or an exchange.
// CHECK-LABEL: variance of @updates
// CHECK: = warp.atomic_components: varies
// CHECK: = warp.atomic_cas: varies
func.func @updates(%x: !warp.array<1 x si32>, %n: i32)
    attributes {warp.kernel} {
  %old = warp.atomic_components add(%n), %x[%n]
    : (i32), !warp.array<1 x si32>, i32 -> i32
  %was = warp.atomic_cas %n, %n, %x[%n]
    : i32, i32, !warp.array<1 x si32>, i32 -> i32
  return
}

// -----

// Views of one array are it; which part differs if an index does.
// CHECK-LABEL: variance of @views
// CHECK: = warp.tid: step 1
// CHECK-NEXT: = warp.view: uniform over the launch
// CHECK-NEXT: = warp.load_components: uniform over the launch
// CHECK-NEXT: = warp.view: varies
// CHECK-NEXT: = warp.load_components: varies
func.func @views(%x: !warp.array<2 x si32>, %n: i32) attributes {warp.kernel} {
  %i = warp.tid : i32
  %row = warp.view %x[%n] : !warp.array<2 x si32>, i32 -> !warp.array<1 x si32>
  %a = warp.load_components %row[%n] : !warp.array<1 x si32>, i32 -> i32
  %own = warp.view %x[%i] : !warp.array<2 x si32>, i32 -> !warp.array<1 x si32>
  %b = warp.load_components %own[%n] : !warp.array<1 x si32>, i32 -> i32
  return
}
