// RUN: warp-opt %s --split-input-file --warp-form-launch \
// RUN:     --warp-widen-threads | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// Where lanes disagree, short arms without effects are both computed.
// CHECK-LABEL: func.func @flattened
// CHECK-NOT: scf.if
// CHECK: %[[IS:.*]] = arith.cmpf ogt, %[[V:.*]], %{{.*}} : vector<4xf32>
// CHECK: %[[THEN:.*]] = arith.addf %[[V]], %[[V]]
// CHECK: %[[ELSE:.*]] = math.sqrt %[[V]]
// CHECK: arith.select %[[IS]], %[[THEN]], %[[ELSE]] : vector<4xi1>, vector<4xf32>
// CHECK: return
func.func @flattened(%x: !warp.array<1 x f32>, %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %p = arith.cmpf ogt, %v, %z : f32
  %r = scf.if %p -> f32 {
    %t = arith.addf %v, %v : f32
    scf.yield %t : f32
  } else {
    %t = math.sqrt %v : f32
    scf.yield %t : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Arms with accesses run if a lane wants them, each under its own mask, which
// is that of the code around it and the condition.
// CHECK-LABEL: func.func @masked
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[IS:.*]] = arith.cmpf ogt
// CHECK: %[[THEN:.*]] = arith.andi %[[LIVE]], %[[IS]]
// CHECK: %[[ANY:.*]] = warp.any %[[THEN]]
// CHECK: %[[A:.*]] = scf.if %[[ANY]] -> (vector<4xf32>) {
// CHECK: %[[LOADED:.*]] = warp.load_lanes unit %arg1[{{.*}}] mask %[[THEN]]
// CHECK: scf.yield %[[LOADED]]
// CHECK: } else {
// CHECK: %[[NOT:.*]] = arith.xori %[[IS]]
// CHECK: %[[ELSE:.*]] = arith.andi %[[LIVE]], %[[NOT]]
// CHECK: %[[OTHER:.*]] = warp.any %[[ELSE]]
// CHECK: %[[B:.*]] = scf.if %[[OTHER]] -> (vector<4xf32>) {
// CHECK: warp.store_lanes unit({{.*}}), %arg1[{{.*}}] mask %[[ELSE]]
// CHECK: arith.select %[[IS]], %[[A]], %[[B]]
// CHECK: warp.store_lanes unit({{.*}}), %arg0[{{.*}}] mask %[[LIVE]]
func.func @masked(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %p = arith.cmpf ogt, %v, %z : f32
  %r = scf.if %p -> f32 {
    %t = warp.load_components %y[%i] : !warp.array<1 x f32>, i32 -> f32
    scf.yield %t : f32
  } else {
    warp.store_components(%z), %y[%i] : (f32), !warp.array<1 x f32>, i32
    scf.yield %v : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// An early return is a branch around the rest: what follows has its mask, and
// nested masks are part of those around them.
// CHECK-LABEL: func.func @nested
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[P:.*]] = arith.cmpf ogt
// CHECK: %[[OUTER:.*]] = arith.andi %[[LIVE]], %[[P]]
// CHECK: scf.if
// CHECK: %[[Q:.*]] = arith.cmpf olt
// CHECK: %[[INNER:.*]] = arith.andi %[[OUTER]], %[[Q]]
// CHECK: %[[ANY:.*]] = warp.any %[[INNER]]
// CHECK: scf.if %[[ANY]]
// CHECK: warp.store_lanes unit({{.*}}), %arg0[{{.*}}] mask %[[INNER]]
// CHECK: warp.store_lanes unit({{.*}}), %arg1[{{.*}}] mask %[[OUTER]]
func.func @nested(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %p = arith.cmpf ogt, %v, %z : f32
  scf.if %p {
    %w = warp.load_components %y[%i] : !warp.array<1 x f32>, i32 -> f32
    %q = arith.cmpf olt, %w, %z : f32
    scf.if %q {
      warp.store_components(%w), %x[%i] : (f32), !warp.array<1 x f32>, i32
    }
    warp.store_components(%v), %y[%i] : (f32), !warp.array<1 x f32>, i32
  }
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// A condition that threads share is a branch, and its arms have the mask of the
// code around it.
// CHECK-LABEL: func.func @agreed
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK-NOT: warp.any
// CHECK: %[[R:.*]] = scf.if %arg1 -> (vector<4xf32>) {
// CHECK: warp.load_lanes unit %arg0[{{.*}}] mask %[[LIVE]]
// CHECK: } else {
// CHECK: warp.store_lanes unit(%[[R]])
func.func @agreed(%x: !warp.array<1 x f32>, %b: i1, %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %r = scf.if %b -> f32 {
    %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
    scf.yield %v : f32
  } else {
    scf.yield %z : f32
  }
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3,
      lanes = 4>

// Integers are divided as doubles, which is exact for 32 bits; by a constant as
// they are. With 64 bits a lane that is not live divides 0 by 1. Division does
// not leave its branch: there its mask is known.
// CHECK-LABEL: func.func @division
// CHECK: ^bb0(%{{.*}}: i32, %[[LIVE:.*]]: vector<4xi1>):
// CHECK: %[[X:.*]] = arith.sitofp %{{.*}} : vector<4xi32> to vector<4xf64>
// CHECK: %[[Y:.*]] = arith.sitofp %{{.*}} : vector<4xi32> to vector<4xf64>
// CHECK: %[[Q:.*]] = arith.divf %[[X]], %[[Y]]
// CHECK: %[[A:.*]] = arith.fptosi %[[Q]]
// CHECK: %[[U:.*]] = arith.divf
// CHECK: %[[T:.*]] = arith.fptoui %[[U]]
// CHECK: %[[P:.*]] = arith.muli %[[T]], %{{.*}}
// CHECK: %[[R:.*]] = arith.subi %[[A]], %[[P]]
// CHECK: arith.divsi %[[R]], %{{.*}} : vector<4xi32>
// CHECK: %[[IS:.*]] = arith.cmpi
// CHECK: %[[MASK:.*]] = arith.andi %[[LIVE]], %[[IS]]
// CHECK: scf.if
// CHECK-DAG: %[[ONE:.*]] = arith.constant dense<1> : vector<4xi64>
// CHECK-DAG: %[[ZERO:.*]] = arith.constant dense<0> : vector<4xi64>
// CHECK-DAG: %[[BY:.*]] = arith.select %[[MASK]], %{{.*}}, %[[ONE]]
// CHECK-DAG: %[[OF:.*]] = arith.select %[[MASK]], %{{.*}}, %[[ZERO]]
// CHECK: arith.remsi %[[OF]], %[[BY]] : vector<4xi64>
func.func @division(%x: !warp.array<1 x si32>, %y: !warp.array<1 x si64>,
                    %n: i32, %m: i64)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %c3 = arith.constant 3 : i32
  %zero = arith.constant 0 : i64
  %v = warp.load_components %x[%i] : !warp.array<1 x si32>, i32 -> i32
  %w = warp.load_components %y[%i] : !warp.array<1 x si64>, i32 -> i64
  %a = arith.divsi %n, %v : i32
  %b = arith.remui %a, %v : i32
  %c = arith.divsi %b, %c3 : i32
  %p = arith.cmpi ne, %w, %zero : i64
  %d = scf.if %p -> i64 {
    %r = arith.remsi %m, %w : i64
    scf.yield %r : i64
  } else {
    scf.yield %zero : i64
  }
  warp.store_components(%c), %x[%i] : (i32), !warp.array<1 x si32>, i32
  warp.store_components(%d), %y[%i] : (i64), !warp.array<1 x si64>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 1,
      lanes = 4>

// Lanes run code that few threads reach only if one of them does, short as it
// is.
// CHECK-LABEL: func.func @rare
// CHECK: %[[ANY:.*]] = warp.any
// CHECK: scf.if %[[ANY]] -> (vector<4xf32>) {
// CHECK: arith.addf
// CHECK: arith.select
// CHECK: return
func.func @rare(%x: !warp.array<1 x f32>, %z: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i = warp.tid : i32
  %v = warp.load_components %x[%i] : !warp.array<1 x f32>, i32 -> f32
  %p = arith.cmpf ogt, %v, %z : f32
  %r = scf.if %p -> f32 {
    %t = arith.addf %v, %v : f32
    scf.yield %t : f32
  } else {
    scf.yield %v : f32
  } {warp.rare}
  warp.store_components(%r), %x[%i] : (f32), !warp.array<1 x f32>, i32
  return
}
