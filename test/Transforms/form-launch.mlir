// RUN: warp-opt %s --split-input-file --warp-form-launch | FileCheck %s

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, non_negative = 4, packed = 1>

// The body becomes a region of threads, their indices its arguments. Each fact
// the launch promises of arguments stays with them: packed arrays, integers
// that are not negative, and names.
// CHECK-LABEL: func.func @line(
// CHECK-SAME: %[[A:[^:]+]]: !warp.array<1 x f32> {warp.name = "a", warp.packed}
// CHECK-SAME: %{{[^:]+}}: !warp.array<1 x f32> {warp.name = "b"}
// CHECK-SAME: %[[N:[^:]+]]: i32 {warp.name = "n", warp.non_negative}
// CHECK-SAME: %{{[^:]+}}: i1 {warp.name = "flag"}
// CHECK-NEXT: warp.group {
// CHECK-NEXT: warp.threads attributes {kinds = array<i32>, types = []} {
// CHECK-NEXT: ^bb0(%[[I:.*]]: i32):
// CHECK-NEXT: warp.store_components(%{{.*}}), %[[A]][%[[I]]]
// CHECK-NEXT: warp.yield
// CHECK-NEXT: }
// CHECK-NEXT: }
// CHECK-NEXT: return
func.func @line(%a: !warp.array<1 x f32>, %b: !warp.array<1 x f32>, %n: i32,
                %flag: i1, %s: f32)
    attributes {warp.kernel, warp.arg_names = ["a", "b", "n", "flag", "s"],
      warp.variant = #cpu} {
  %i = warp.tid : i32
  warp.store_components(%s), %a[%i] : (f32), !warp.array<1 x f32>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, rank = 2>

// A launch has as many indices as dimensions; others are 0, and wider ones are
// extended where they are asked for.
// CHECK-LABEL: func.func @plane(
// CHECK: ^bb0(%[[I:.*]]: i32, %[[J:.*]]: i32):
// CHECK: %[[ZERO:.*]] = arith.constant 0 : i32
// CHECK: warp.store_components({{.*}}), %{{.*}}[%[[I]], %[[J]], %[[ZERO]]]
// CHECK: %[[WIDE:.*]] = arith.extsi %[[J]] : i32 to i64
// CHECK: warp.store_components(%[[WIDE]]), %{{.*}}[%[[I]]]
// CHECK-NOT: warp.tid
func.func @plane(%a: !warp.array<3 x f32>, %b: !warp.array<1 x si64>, %s: f32)
    attributes {warp.kernel, warp.variant = #cpu} {
  %i, %j, %k = warp.tid : i32, i32, i32
  warp.store_components(%s), %a[%i, %j, %k]
    : (f32), !warp.array<3 x f32>, i32, i32, i32
  %i64, %j64 = warp.tid : i64, i64
  warp.store_components(%j64), %b[%i] : (i64), !warp.array<1 x si64>, i32
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>, packed = 3>

// Arguments that were taken apart: facts are those of the whole, names of
// struct fields are paths, and an array in a struct is not promised packed.
// CHECK-LABEL: func.func @records(
// CHECK-SAME: f32 {warp.name = "v"}
// CHECK-SAME: f32 {warp.name = "v"}
// CHECK-SAME: !warp.array<1 x f32> {warp.name = "s.a"}
// CHECK-SAME: i64 {warp.name = "s.n"}
func.func @records(%x: f32, %y: f32, %a: !warp.array<1 x f32>, %n: i64)
    attributes {warp.kernel, warp.variant = #cpu,
      warp.arg_names = ["v", "s"], warp.arg_types = [!warp.vec<2 x f32>,
        !warp.struct<"S", {a: !warp.array<1 x f32>, n: si64}>]} {
  return
}

// -----

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// The slot of a handle that is an argument is found before loops, and so are
// its words and the header of a volume's grid; not what lies where a loop says,
// values of the grid, or what a handle from elsewhere has.
// CHECK-LABEL: func.func @march(
// CHECK-SAME: %[[ID:[^:]+]]: i64
// CHECK: %[[SLOT:.*]] = warp.library_call "warp_slot"(%[[ID]],
// CHECK: %[[WORDS:.*]] = warp.array_at %[[SLOT]]
// CHECK: %[[GRID:.*]] = warp.load_components %[[WORDS]]
// CHECK: %[[HEADER:.*]] = warp.array_at %[[GRID]][%{{.*}}] :
// CHECK: warp.load_components %[[HEADER]]
// CHECK-NOT: load_components
// CHECK: scf.for %[[I:.*]] = {{.*}} {
// CHECK-NOT: "warp_slot"(%[[ID]]
// CHECK: scf.if
// CHECK-DAG: warp.load_components %[[WORDS]][%[[I]]]
// CHECK-DAG: %[[ROWS:.*]] = warp.array_at %[[GRID]][%{{.*}}, %{{.*}}]
// CHECK-DAG: warp.load_components %[[ROWS]]
// CHECK-DAG: warp.library_call "warp_slot"
// CHECK: warp.store_components
func.func @march(%id: i64, %ids: !warp.array<1 x ui64>,
                 %out: !warp.array<1 x f64>, %flag: i1)
    attributes {warp.kernel, warp.arg_types = [ui64, !warp.array<1 x ui64>,
      !warp.array<1 x f64>, i1], warp.variant = #cpu} {
  %c0 = arith.constant 0 : i32
  %c9 = arith.constant 9 : i32
  %c1 = arith.constant 1 : i32
  scf.for %i = %c0 to %c9 step %c1 : i32 {
    scf.if %flag {
      %volume = arith.constant 4 : i32
      %size = arith.constant 32 : i32
      %slot = warp.library_call "warp_slot"(%id, %volume) : (i64, i32) -> i64
      %words = warp.array_at %slot[%size] : i64, i32 -> !warp.array<1 x ui64>
      %grid = warp.load_components %words[%c1] : !warp.array<1 x ui64>, i32 -> i64
      %header = warp.array_at %grid[%size] : i64, i32 -> !warp.array<1 x f64>
      %a = warp.load_components %header[%c9] : !warp.array<1 x f64>, i32 -> f64
      %word = warp.load_components %words[%i] : !warp.array<1 x ui64>, i32 -> i64
      %rows = warp.array_at %grid[%size, %c9] : i64, i32, i32 -> !warp.array<2 x f64>
      %b = warp.load_components %rows[%c0, %c0] : !warp.array<2 x f64>, i32, i32 -> f64
      %other = warp.load_components %ids[%c0] : !warp.array<1 x ui64>, i32 -> i64
      %there = warp.library_call "warp_slot"(%other, %volume) : (i64, i32) -> i64
      %theirs = warp.array_at %there[%size] : i64, i32 -> !warp.array<1 x ui64>
      %c = warp.load_components %theirs[%c0] : !warp.array<1 x ui64>, i32 -> i64
      %bits = arith.addi %word, %c : i64
      %d = arith.sitofp %bits : i64 to f64
      %ab = arith.addf %a, %b : f64
      %sum = arith.addf %ab, %d : f64
      warp.store_components(%sum), %out[%i] : (f64), !warp.array<1 x f64>, i32
    }
  }
  return
}

// -----

#gpu = #warp.variant<target = <name = "sm_90">>

// On a GPU, loops keep them: registers are for more threads.
// CHECK-LABEL: func.func @march_on_gpu(
// CHECK: scf.for
// CHECK: warp.library_call "warp_slot"
// CHECK: warp.load_components
func.func @march_on_gpu(%id: i64, %out: !warp.array<1 x f64>)
    attributes {warp.kernel, warp.arg_types = [ui64, !warp.array<1 x f64>],
      warp.variant = #gpu} {
  %c0 = arith.constant 0 : i32
  %c9 = arith.constant 9 : i32
  %c1 = arith.constant 1 : i32
  %volume = arith.constant 4 : i32
  scf.for %i = %c0 to %c9 step %c1 : i32 {
    %slot = warp.library_call "warp_slot"(%id, %volume) : (i64, i32) -> i64
    %words = warp.array_at %slot[%c9] : i64, i32 -> !warp.array<1 x ui64>
    %grid = warp.load_components %words[%c1] : !warp.array<1 x ui64>, i32 -> i64
    %header = warp.array_at %grid[%c9] : i64, i32 -> !warp.array<1 x f64>
    %a = warp.load_components %header[%c0] : !warp.array<1 x f64>, i32 -> f64
    warp.store_components(%a), %out[%i] : (f64), !warp.array<1 x f64>, i32
  }
  return
}
