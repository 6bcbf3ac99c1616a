// RUN: warp-opt %s --split-input-file --warp-fuse-multiply-add | FileCheck %s

// Sums and differences take over a product; of two the left one, whatever
// order they are computed in.
// CHECK-LABEL: func.func @forms
// CHECK-SAME: %[[A:[^:]+]]: f32, %[[B:[^:]+]]: f32, %[[C:[^:]+]]: f32
// CHECK: %[[LEFT:.*]] = math.fma %[[A]], %[[B]], %[[C]] : f32
// CHECK: %[[RIGHT:.*]] = math.fma %[[A]], %[[B]], %[[C]] : f32
// CHECK: %[[MINUS:.*]] = arith.negf %[[C]] : f32
// CHECK: %[[LESS:.*]] = math.fma %[[A]], %[[B]], %[[MINUS]] : f32
// CHECK: %[[MINUS_A:.*]] = arith.negf %[[A]] : f32
// CHECK: %[[FROM:.*]] = math.fma %[[MINUS_A]], %[[B]], %[[C]] : f32
// CHECK: %[[OTHER:.*]] = arith.mulf %[[B]], %[[C]] : f32
// CHECK: %[[BOTH:.*]] = math.fma %[[A]], %[[A]], %[[OTHER]] : f32
// CHECK: warp.store_components(%[[LEFT]], %[[RIGHT]], %[[LESS]], %[[FROM]], %[[BOTH]])
func.func @forms(%a: f32, %b: f32, %c: f32,
                 %y: !warp.array<1 x !warp.vec<5 x f32>>)
    attributes {warp.kernel} {
  %i = warp.tid : i32
  %p0 = arith.mulf %a, %b : f32
  %left = arith.addf %p0, %c : f32
  %p1 = arith.mulf %a, %b : f32
  %right = arith.addf %c, %p1 : f32
  %p2 = arith.mulf %a, %b : f32
  %less = arith.subf %p2, %c : f32
  %p3 = arith.mulf %a, %b : f32
  %from = arith.subf %c, %p3 : f32
  %p4 = arith.mulf %b, %c : f32
  %p5 = arith.mulf %a, %a : f32
  %both = arith.addf %p5, %p4 : f32
  warp.store_components(%left, %right, %less, %from, %both), %y[%i]
    : (f32, f32, f32, f32, f32), !warp.array<1 x !warp.vec<5 x f32>>, i32
  return
}

// -----

// A product with another use is rounded anyway; one of another block would be
// computed more often; `warp.exact` on either operation forbids it; and 16 bits
// are computed with 32 on a CPU.
// CHECK-LABEL: func.func @kept
// CHECK-NOT: math.fma
// CHECK: return
func.func @kept(%a: f32, %n: i32, %h: f16, %y: !warp.array<1 x f32>,
                %z: !warp.array<1 x f16>) attributes {warp.kernel} {
  %i = warp.tid : i32
  %c0 = arith.constant 0 : i32
  %c1 = arith.constant 1 : i32
  %p = arith.mulf %a, %a : f32
  %s = arith.addf %p, %a : f32
  %t = arith.subf %s, %p : f32
  warp.store_components(%t), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %outside = arith.mulf %a, %t : f32
  %r = scf.for %k = %c0 to %n step %c1 iter_args(%v = %a) -> f32 : i32 {
    %next = arith.addf %v, %outside : f32
    scf.yield %next : f32
  }
  warp.store_components(%r), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %q = arith.mulf %a, %a {warp.exact} : f32
  %u = arith.addf %q, %a : f32
  warp.store_components(%u), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %o = arith.mulf %a, %a : f32
  %w = arith.addf %o, %a {warp.exact} : f32
  warp.store_components(%w), %y[%i] : (f32), !warp.array<1 x f32>, i32
  %g = arith.mulf %h, %h : f16
  %j = arith.addf %g, %h : f16
  warp.store_components(%j), %z[%i] : (f16), !warp.array<1 x f16>, i32
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// A GPU fuses 16 bits, too.
// CHECK-LABEL: func.func @gpu
// CHECK: math.fma %{{.*}} : f16
func.func @gpu(%h: f16, %z: !warp.array<1 x f16>)
    attributes {warp.kernel, warp.variant = #gpu} {
  %i = warp.tid : i32
  %g = arith.mulf %h, %h : f16
  %j = arith.addf %g, %h : f16
  warp.store_components(%j), %z[%i] : (f16), !warp.array<1 x f16>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 128>>

// Processors with vectors of less than 256 bits have no such instruction, and
// the same bits.
// CHECK-LABEL: func.func @small
// CHECK: math.fma
func.func @small(%a: f64, %y: !warp.array<1 x f64>)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %p = arith.mulf %a, %a : f64
  %s = arith.addf %p, %a : f64
  warp.store_components(%s), %y[%i] : (f64), !warp.array<1 x f64>, i32
  return
}
