// RUN: warp-opt %s --split-input-file --warp-print-variance -o /dev/null \
// RUN:   | FileCheck %s

// Sums over thread indices, extents and arguments, in whatever order; products
// with what is not constant; what cancels is gone.
// CHECK-LABEL: variance of @sums
// CHECK: %{{.*}}: uniform over the launch
// CHECK-NEXT: %[[N:[^:]*]]: uniform over the launch
// CHECK: = warp.dim: uniform over the launch = dim(%{{.*}}, 1) in [0, ]
// CHECK: = arith.muli: uniform over lanes = dim(%{{.*}}, 1) t0{{$}}
// CHECK-NEXT: = arith.addi: step 1 = dim(%{{.*}}, 1) t0 + t1{{$}}
// CHECK-NEXT: = arith.subi: step 0 = dim(%{{.*}}, 1) t0{{$}}
// CHECK-NEXT: = arith.addi: step 2 = 2 t1{{$}}
// CHECK: = arith.muli: step 6 = 6 t1 + 3 %[[N]] + 12
// CHECK: = arith.shli: step 4 = 4 t1
func.func @sums(%a: !warp.array<2 x f32>, %n: i32) attributes {warp.kernel} {
  %c2 = arith.constant 2 : i32
  %c3 = arith.constant 3 : i32
  %c4 = arith.constant 4 : i32
  %i, %j = warp.tid : i32, i32
  %m = warp.dim %a, 1 : !warp.array<2 x f32> -> i32
  %row = arith.muli %m, %i : i32
  %at = arith.addi %row, %j : i32
  %back = arith.subi %at, %j : i32
  %twice = arith.addi %j, %j : i32
  %x = arith.addi %twice, %n : i32
  %y = arith.addi %c4, %x : i32
  %z = arith.muli %y, %c3 : i32
  %s = arith.shli %j, %c2 : i32
  return
}

// -----

// Extents of views are those of the array that they are taken of.
// CHECK-LABEL: variance of @extents
// CHECK: %[[A:[^:]*]]: uniform over the launch
// CHECK-COUNT-2: = warp.dim: uniform over the launch = dim(%[[A]], 1) in [0, ]
// CHECK: = arith.subi: uniform over the launch = 0
func.func @extents(%a: !warp.array<2 x !warp.vec<3 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : i32
  %row = warp.view %a[%i]
    : !warp.array<2 x !warp.vec<3 x f32>>, i32
      -> !warp.array<1 x !warp.vec<3 x f32>>
  %n = warp.dim %row, 0 : !warp.array<1 x !warp.vec<3 x f32>> -> i32
  %m = warp.dim %a, 1 : !warp.array<2 x !warp.vec<3 x f32>> -> i32
  %zero = arith.subi %n, %m : i32
  return
}

// -----

// A counter is the lower bound and a step per trip; what is carried grows by
// what every iteration adds.
// CHECK-LABEL: variance of @loops
// CHECK: %[[N:[^:]*]]: uniform over the launch
// CHECK: scf.for: in step
// CHECK: %[[K:[^:]*]]: uniform over lanes = 2 trip(%[[K]]) + 1 in [1, ]
// CHECK-NEXT: %{{.*}}: step 1 = t0 + trip(%[[K]]) %[[N]]{{$}}
// CHECK-NEXT: %{{.*}}: uniform over lanes{{$}}
// CHECK: scf.while: in step
// CHECK: %[[B:[^:]*]]: uniform over lanes = 3 trip(%[[B]]){{$}}
// CHECK: %{{.*}}: uniform over lanes = 3 trip(%[[B]]){{$}}
// CHECK: = arith.addi: uniform over lanes = 3 trip(%[[B]]) + 3{{$}}
func.func @loops(%n: i32) attributes {warp.kernel} {
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %c2 = arith.constant 2 : i32
  %c3 = arith.constant 3 : i32
  %i = warp.tid : i32
  %r:2 = scf.for %k = %c1 to %n step %c2 iter_args(%a = %i, %c = %c0)
      -> (i32, i32) : i32 {
    %x = arith.addi %a, %n : i32
    %z = arith.addi %c, %k : i32
    scf.yield %x, %z : i32, i32
  }
  %end = scf.while (%k = %c0) : (i32) -> i32 {
    %more = arith.cmpi slt, %k, %n : i32
    scf.condition(%more) %k : i32
  } do {
  ^bb0(%k: i32):
    %m = arith.addi %k, %c3 : i32
    scf.yield %m : i32
  }
  return
}

// -----

// A wider number is the same sum only if the narrower one did not wrap. An
// unsigned one may be a negative one that wrapped.
// CHECK-LABEL: variance of @wider
// CHECK: = arith.extsi: step 1 = t0 in [0, ]
// CHECK: = arith.extsi: step 4 = 4 t0 if no sum wraps
// CHECK: = arith.extui: varies in [0, ]
// CHECK: = arith.trunci: step 4 = 4 t0 if no sum wraps
func.func @wider() attributes {warp.kernel} {
  %c1 = arith.constant 1 : i32
  %c4 = arith.constant 4 : i32
  %i = warp.tid : i32
  %a = arith.extsi %i : i32 to i64
  %four = arith.muli %i, %c4 : i32
  %b = arith.extsi %four : i32 to i64
  %less = arith.subi %i, %c1 : i32
  %c = arith.extui %less : i32 to i64
  %d = arith.trunci %b : i64 to i32
  return
}

// -----

// Beyond six terms, and in products of more than three, a sum is a value.
// CHECK-LABEL: variance of @long
// CHECK: %[[FIVE:.*]] = arith.addi: uniform over the launch = %{{.*}} + %{{.*}} + %{{.*}} + %{{.*}} + %{{.*}} + %{{.*}}
// CHECK-NEXT: %[[SIX:.*]] = arith.addi: uniform over the launch{{$}}
// CHECK: = arith.addi: step 1 = %[[SIX]] + t0{{$}}
func.func @long(%a: i32, %b: i32, %c: i32, %d: i32, %e: i32, %f: i32, %g: i32)
    attributes {warp.kernel} {
  %0 = arith.addi %a, %b : i32
  %1 = arith.addi %0, %c : i32
  %2 = arith.addi %1, %d : i32
  %3 = arith.addi %2, %e : i32
  %4 = arith.addi %3, %f : i32
  %5 = arith.addi %4, %g : i32
  %i = warp.tid : i32
  %6 = arith.addi %5, %i : i32
  return
}
