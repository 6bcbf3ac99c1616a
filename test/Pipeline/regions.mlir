// RUN: split-file %s %t
// RUN: warp-opt %t/trajectory.mlir --warp-emit=regions | FileCheck %t/trajectory.mlir
// RUN: warp-opt %t/loop.mlir --warp-emit=regions | FileCheck %t/loop.mlir
// RUN: warp-opt %t/choice.mlir --warp-emit=regions | FileCheck %t/choice.mlir
// RUN: warp-opt %t/barrier.mlir --warp-emit=regions | FileCheck %t/barrier.mlir
// RUN: warp-opt %t/unknown.mlir --warp-emit=regions | FileCheck %t/unknown.mlir
// RUN: warp-opt %t/trajectory.mlir --warp-emit=adjoint --warp-options=apart=1 | FileCheck %t/trajectory.mlir --check-prefix=APART
// RUN: not warp-opt %t/trajectory.mlir --warp-emit=adjoint 2>&1 | FileCheck %t/trajectory.mlir --check-prefix=RACE
// RUN: not warp-opt %t/trajectory.mlir --warp-emit=adjoint --warp-options=apart=11 2>&1 | FileCheck %t/trajectory.mlir --check-prefix=FLAGS

//--- trajectory.mlir
// Rows are told apart by an argument, neighbours by the thread; what is made of
// arguments alone is computed at the launch, whatever operation it is.
// CHECK: read x[(k % n), 1 + 1 * extent(0)]
// CHECK-NEXT: write x[((k + 1) % n), 0 + 1 * extent(0)]

// A launch whose rows differ needs no copy of what was there before, and adds
// to gradients without atomics.
// APART-LABEL: func.func @step_adjoint
// APART-NOT: warp.hidden
// APART: warp.accumulate {{.*}} {unique = 1 : i64}
// APART-NOT: hidden

// RACE: 'x' is read here, and other threads of the launch may write what is read
// FLAGS: expects 1 flags of arrays read and written in different places, but got 2
module {
  func.func @step(%x: !warp.array<2 x f32>, %k: si32, %n: si32)
      attributes {warp.arg_names = ["x", "k", "n"], warp.kernel} {
    %i = warp.tid : si32
    %one = warp.constant 1 : si32
    %j = warp.add(%i, %one) : (si32, si32) -> si32
    %next = warp.add(%k, %one) : (si32, si32) -> si32
    %from = warp.mod(%k, %n) : (si32, si32) -> si32
    %to = warp.mod(%next, %n) : (si32, si32) -> si32
    %v = warp.load %x[%from, %j] : !warp.array<2 x f32>, si32, si32 -> f32
    %r = warp.mul(%v, %v) : (f32, f32) -> f32
    warp.store %r, %x[%to, %i] : f32, !warp.array<2 x f32>, si32, si32
    return
  }
}

//--- loop.mlir
// A counter goes from its bound in steps, the last of which may be a part of
// one; views add their indices in front; an extent is read from the array.
// CHECK: read x[(k + 1), 2 + 3 * (((x.shape[1] - 2) + 2) // 3)]
// CHECK-NEXT: write y[0 + n * extent(0)]
module {
  func.func @loop(%x: !warp.array<2 x f32>, %y: !warp.array<1 x f32>,
                  %k: si32, %n: si32)
      attributes {warp.arg_names = ["x", "y", "k", "n"], warp.kernel} {
    %i = warp.tid : si32
    %one = warp.constant 1 : si32
    %next = warp.add(%k, %one) : (si32, si32) -> si32
    %row = warp.view %x[%next] : !warp.array<2 x f32>, si32 -> !warp.array<1 x f32>
    %extent = warp.dim %row, 0 : !warp.array<1 x f32> -> si32
    %end = warp.cast %extent : si32 to i32
    %c2 = arith.constant 2 : i32
    %c3 = arith.constant 3 : i32
    %at = warp.mul(%i, %n) : (si32, si32) -> si32
    scf.for %c = %c2 to %end step %c3 : i32 {
      %j = warp.cast %c : i32 to si32
      %v = warp.load %row[%j] : !warp.array<1 x f32>, si32 -> f32
      warp.store %v, %y[%at] : f32, !warp.array<1 x f32>, si32
    }
    return
  }
}

//--- choice.mlir
// A choice is followed both ways; an index that is loaded may be any.
// CHECK: read p[0 + 1 * extent(0)]
// CHECK-NEXT: read x[0 + 1 * extent(0)]
// CHECK-NEXT: read x[3]
// CHECK-NEXT: write x[*]
module {
  func.func @choice(%p: !warp.array<1 x si32>, %x: !warp.array<1 x f32>)
      attributes {warp.arg_names = ["p", "x"], warp.kernel} {
    %i = warp.tid : si32
    %three = warp.constant 3 : si32
    %low = warp.min(%i, %three) : (si32, si32) -> si32
    %j = warp.load %p[%i] : !warp.array<1 x si32>, si32 -> si32
    %v = warp.load %x[%low] : !warp.array<1 x f32>, si32 -> f32
    warp.store %v, %x[%j] : f32, !warp.array<1 x f32>, si32
    return
  }
}

//--- unknown.mlir
// Which array a branch gives is not known, so both are touched as a whole.
// CHECK-NOT: read
// CHECK: all of x
// CHECK-NEXT: all of y
module {
  func.func @unknown(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %c: i1)
      attributes {warp.arg_names = ["x", "y", "c"], warp.kernel} {
    %i = warp.tid : si32
    %a = scf.if %c -> (!warp.array<1 x f32>) {
      scf.yield %x : !warp.array<1 x f32>
    } else {
      scf.yield %y : !warp.array<1 x f32>
    }
    %v = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
    warp.store %v, %a[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
}

//--- barrier.mlir
// Threads that wait for each other reach no more memory than those that do not.
// CHECK-NOT: no argument names
// CHECK: write x[0 + 1 * extent(0)]
// CHECK-NOT: no argument names
func.func @wait(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x"]} {
  %i = warp.tid : si32
  %c = warp.constant 1.0 : f32
  warp.barrier
  warp.store %c, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
