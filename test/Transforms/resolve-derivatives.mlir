// RUN: warp-opt %s -split-input-file -warp-resolve-derivatives | FileCheck %s
// RUN: warp-opt %s -split-input-file -warp-resolve-derivatives=keep-derivatives=true | FileCheck %s -check-prefix=KEEP

// A function without a derivative of its own gets one: values in and out, no
// memory.
// CHECK-LABEL: @automatic(
// CHECK: %[[X:.*]] = warp.load
// CHECK: %[[G:.*]] = call @square_vjp(%[[X]], %{{.*}}) : (f32, f32) -> f32
// CHECK: warp.store %[[G]]
// CHECK-LABEL: func.func private @square_vjp(
// CHECK-SAME: %[[A:.*]]: f32, %[[S:.*]]: f32) -> f32
// CHECK-NOT: warp.load
// CHECK-DAG: %[[M:.*]] = warp.mul(%[[S]], %[[A]])
// CHECK-DAG: %[[N:.*]] = warp.mul(%[[A]], %[[S]])
// CHECK: %[[R:.*]] = warp.add(%[[M]], %[[N]])
// CHECK: return %[[R]]
func.func @automatic(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %g = warp.vjp @square(%v) of (%one) : (f32), (f32) -> (f32)
  warp.store %g, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @square(%a: f32) -> f32 {
  %r = warp.mul(%a, %a) : (f32, f32) -> f32
  return %r : f32
}

// -----

// Second derivatives are tangents of gradients.
// CHECK-LABEL: @second(
// CHECK: call @gradient_jvp(
// CHECK-LABEL: func.func private @gradient_jvp(
// CHECK-SAME: %[[A:.*]]: f32, %[[T:.*]]: f32) -> f32
// CHECK-NOT: warp.vjp
func.func @second(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %h = warp.jvp @gradient(%v) of (%one) : (f32), (f32) -> (f32)
  warp.store %h, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @gradient(%a: f32) -> f32 {
  %one = warp.constant 1.0 : f32
  %g = warp.vjp @cube(%a) of (%one) : (f32), (f32) -> (f32)
  return %g : f32
}
func.func private @cube(%a: f32) -> f32 {
  %q = warp.mul(%a, %a) : (f32, f32) -> f32
  %r = warp.mul(%q, %a) : (f32, f32) -> f32
  return %r : f32
}

// -----

// A derivative of its own is used as it is, with the residuals of a call.
// CHECK-LABEL: @custom(
// CHECK: %[[F:.*]]:2 = call @f(%[[X:.*]]) : (f32)
// CHECK: call @g(%[[X]], %[[F]]#1, %{{.*}}) : (f32, f64, f32) -> f32
func.func @custom(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %h = warp.vjp @f(%v) of (%one) : (f32), (f32) -> (f32)
  warp.store %h, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @f(%a: f32) -> (f32, f64) attributes {warp.vjp = @g, warp.residuals = 1 : i64} {
  %r = warp.constant 2.0 : f64
  return %a, %r : f32, f64
}
func.func private @g(%a: f32, %r: f64, %s: f32) -> f32 {
  return %s : f32
}

// -----

// The primal drops derivatives that it does not call; the adjoint keeps them.
// CHECK-LABEL: @primal(
// CHECK: call @f(
// CHECK: func.func private @f(%{{.*}}: f32) -> f32 {
// CHECK-NOT: @g
// KEEP-LABEL: @primal(
// KEEP: func.func private @f({{.*}}) -> f32 attributes {warp.vjp = @g}
// KEEP: func.func private @g(
// KEEP-NOT: @unused
func.func @primal(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %h = call @f(%v) : (f32) -> f32
  warp.store %h, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @f(%a: f32) -> f32 attributes {warp.vjp = @g} {
  return %a : f32
}
func.func private @g(%a: f32, %s: f32) -> f32 {
  return %s : f32
}
func.func private @unused(%a: f32) -> f32 {
  return %a : f32
}

// -----

// Where values are recovered without being computed, the derivative is made.
// KEEP-LABEL: @replayed(
// KEEP: func.func private @f({{.*}}) -> f32 attributes {warp.replay = @r, warp.vjp = @f_vjp}
// KEEP: func.func private @f_vjp(%{{.*}}: f32, %{{.*}}: f32) -> f32
func.func @replayed(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %h = call @f(%v) : (f32) -> f32
  warp.store %h, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @f(%a: f32) -> f32 attributes {warp.replay = @r} {
  %r = warp.sin(%a) : (f32) -> f32
  return %r : f32
}
func.func private @r(%a: f32) -> f32 {
  return %a : f32
}

// -----

// The cotangent of one argument is that of the result: it follows when the
// latter becomes a parameter.
// CHECK-LABEL: @linear(
// CHECK-LABEL: func.func private @sum_vjp(
// CHECK-SAME: %{{.*}}: f32, %{{.*}}: f32, %[[S:.*]]: f32) -> (f32, f32)
// CHECK: return %[[S]], %[[S]]
func.func @linear(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %g:2 = warp.vjp @sum(%v, %one) of (%one) : (f32, f32), (f32) -> (f32, f32)
  %h = warp.add(%g#0, %g#1) : (f32, f32) -> f32
  warp.store %h, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @sum(%a: f32, %b: f32) -> f32 {
  %r = warp.add(%a, %b) : (f32, f32) -> f32
  return %r : f32
}

// -----

// Arguments after the last one whose cotangent is used are constants: the
// derivative of the square root, which nobody asks for, is not computed.
// CHECK-LABEL: @unused(
// CHECK-LABEL: func.func private @scaled_vjp(
// CHECK-SAME: %{{.*}}: f32, %{{.*}}: f32, %{{.*}}: f32) -> (f32, f32)
// CHECK-NOT: warp.div
// CHECK: return
func.func @unused(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %one = warp.constant 1.0 : f32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %g:2 = warp.vjp @scaled(%v, %v) of (%one) : (f32, f32), (f32) -> (f32, f32)
  warp.store %g#0, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @scaled(%a: f32, %b: f32) -> f32 {
  %s = warp.sqrt(%b) : (f32) -> f32
  %r = warp.mul(%a, %s) : (f32, f32) -> f32
  return %r : f32
}

// -----

// A replay leaves memory alone; the old value of an atomic is refused
// elsewhere, this one has no use.
// KEEP-LABEL: @effects(
// KEEP: func.func private @f({{.*}}) -> f32 attributes {warp.replay = @f_replay, warp.vjp = @g}
// KEEP: func.func private @f_replay(
// KEEP-NOT: warp.atomic
// KEEP-NOT: warp.store
// KEEP: return
func.func @effects(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %h = call @f(%v, %x) : (f32, !warp.array<1 x f32>) -> f32
  warp.store %h, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @f(%a: f32, %x: !warp.array<1 x f32>) -> f32 attributes {warp.vjp = @g} {
  %i = warp.tid : si32
  %old = warp.atomic add %a, %x[%i] : f32, !warp.array<1 x f32>, si32 -> f32
  call @h(%a, %x) : (f32, !warp.array<1 x f32>) -> ()
  return %a : f32
}
func.func private @h(%a: f32, %x: !warp.array<1 x f32>) {
  %i = warp.tid : si32
  warp.store %a, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
func.func private @g(%a: f32, %x: !warp.array<1 x f32>, %s: f32) -> f32 {
  return %s : f32
}
