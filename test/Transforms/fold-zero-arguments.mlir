// RUN: warp-opt %s --split-input-file --warp-fold-zero-arguments | FileCheck %s

#general = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, disjoint = true>

// The general code says that a zero count leaves out the loop.
// CHECK-LABEL: func.func @count
// CHECK-SAME: warp.schedule = #warp.schedule<{{.*}}switches = 4
// CHECK: scf.for
func.func @count(%p: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32) attributes {
    warp.kernel, warp.variant = #general, warp.arg_names = ["p", "y", "n"],
    warp.arg_types = [!warp.array<1 x f32>, !warp.array<1 x f32>, si32]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %x = warp.load %y[%i] : !warp.array<1 x f32>, i32 -> f32
  %s = scf.for %k = %c0 to %n step %c1 iter_args(%a = %x) -> (f32) : i32 {
    %v = warp.load %p[%k] : !warp.array<1 x f32>, i32 -> f32
    %d = arith.subf %v, %x : f32
    %e = arith.mulf %d, %d : f32
    %f = arith.addf %e, %v : f32
    %g = arith.mulf %f, %d : f32
    %h = arith.addf %g, %f : f32
    %t = arith.addf %a, %h : f32
    scf.yield %t : f32
  }
  warp.store %s, %y[%i] : f32, !warp.array<1 x f32>, i32
  return
}

// -----

#zero = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, disjoint = true, zeros = 4>

// The version has no loop; a product that the loop used is rounded, as there.
// CHECK-LABEL: func.func @version
// CHECK-NOT: scf.for
// CHECK: %[[X:.*]] = warp.load %arg1
// CHECK-NEXT: %[[P:.*]] = arith.mulf %[[X]], %[[X]] {warp.exact}
// CHECK-NEXT: %[[R:.*]] = arith.addf %[[P]], %[[X]]
// CHECK-NEXT: warp.store %[[R]]
func.func @version(%p: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %n: i32) attributes {
    warp.kernel, warp.variant = #zero, warp.arg_names = ["p", "y", "n"],
    warp.arg_types = [!warp.array<1 x f32>, !warp.array<1 x f32>, si32]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  %i = warp.tid : i32
  %x = warp.load %y[%i] : !warp.array<1 x f32>, i32 -> f32
  %m = arith.mulf %x, %x : f32
  %end = arith.muli %n, %c2 : i32
  %s = scf.for %k = %c0 to %end step %c1 iter_args(%a = %m) -> (f32) : i32 {
    %v = warp.load %p[%k] : !warp.array<1 x f32>, i32 -> f32
    %t = arith.addf %a, %v : f32
    scf.yield %t : f32
  }
  %r = arith.addf %s, %x : f32
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, i32
  return
}

// -----

#zero = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, disjoint = true, zeros = 6>

// The else branch of a false flag stays, with its products rounded where they
// leave it or come from outside; the element of an array counts like an
// argument.
// CHECK-LABEL: func.func @branches
// CHECK-NOT: scf
// CHECK: %[[X:.*]] = warp.load %arg0
// CHECK-NEXT: %[[M:.*]] = arith.mulf %[[X]], %[[X]] {warp.exact}
// CHECK-NEXT: %[[E:.*]] = arith.addf %[[M]], %[[X]]
// CHECK-NEXT: %[[Q:.*]] = arith.mulf %[[E]], %[[X]] {warp.exact}
// CHECK-NEXT: %[[R:.*]] = arith.addf %[[Q]], %[[X]]
// CHECK-NEXT: warp.store %[[R]]
// CHECK-NEXT: return
func.func @branches(%y: !warp.array<1 x f32>, %n: !warp.array<1 x si32>, %on: i1) attributes {
    warp.kernel, warp.variant = #zero, warp.arg_names = ["y", "n", "on"],
    warp.arg_types = [!warp.array<1 x f32>, !warp.array<1 x si32>, i1]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %x = warp.load %y[%i] : !warp.array<1 x f32>, i32 -> f32
  %m = arith.mulf %x, %x : f32
  %s = scf.if %on -> (f32) {
    scf.yield %x : f32
  } else {
    %e = arith.addf %m, %x : f32
    %q = arith.mulf %e, %x : f32
    scf.yield %q : f32
  }
  %r = arith.addf %s, %x : f32
  %count = warp.load_components %n[%c0] : !warp.array<1 x si32>, i32 -> i32
  scf.for %k = %c0 to %count step %c1 : i32 {
    warp.store %x, %y[%k] : f32, !warp.array<1 x f32>, i32
  }
  warp.store %r, %y[%i] : f32, !warp.array<1 x f32>, i32
  return
}

// -----

#general = #warp.variant<target = <name = "cpu", bits = 512>, packed = 3, disjoint = true>

// An array that the kernel writes is no switch.
// CHECK-LABEL: func.func @written
// CHECK-NOT: switches
func.func @written(%y: !warp.array<1 x si32>, %n: !warp.array<1 x si32>) attributes {
    warp.kernel, warp.variant = #general, warp.arg_names = ["y", "n"],
    warp.arg_types = [!warp.array<1 x si32>, !warp.array<1 x si32>]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %count = warp.load_components %n[%c0] : !warp.array<1 x si32>, i32 -> i32
  scf.for %k = %c0 to %count step %c1 : i32 {
    %a = arith.addi %k, %i : i32
    %b = arith.muli %a, %a : i32
    %c = arith.addi %b, %a : i32
    %d = arith.muli %c, %b : i32
    %e = arith.addi %d, %c : i32
    warp.store_components(%e), %y[%k] : (i32), !warp.array<1 x si32>, i32
    warp.store_components(%d), %n[%i] : (i32), !warp.array<1 x si32>, i32
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">, packed = 3, disjoint = true>

// The host does not read the memory of a GPU.
// CHECK-LABEL: func.func @device
// CHECK-NOT: switches
func.func @device(%y: !warp.array<1 x si32>, %n: !warp.array<1 x si32>) attributes {
    warp.kernel, warp.variant = #gpu, warp.arg_names = ["y", "n"],
    warp.arg_types = [!warp.array<1 x si32>, !warp.array<1 x si32>]} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %i = warp.tid : i32
  %count = warp.load_components %n[%c0] : !warp.array<1 x si32>, i32 -> i32
  scf.for %k = %c0 to %count step %c1 : i32 {
    %a = arith.addi %k, %i : i32
    %b = arith.muli %a, %a : i32
    %c = arith.addi %b, %a : i32
    %d = arith.muli %c, %b : i32
    %e = arith.addi %d, %c : i32
    warp.store_components(%e), %y[%k] : (i32), !warp.array<1 x si32>, i32
  }
  return
}
