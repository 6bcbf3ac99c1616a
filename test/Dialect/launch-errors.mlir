// RUN: warp-opt %s -verify-diagnostics -split-input-file

func.func @group_c1(%b: i1) {
  scf.if %b {
    // expected-error@+1 {{(C1) expects to stand in a function}}
    warp.group {
      warp.threads attributes {kinds = array<i32>, types = []} {
      ^bb0(%i: i32):
        warp.yield
      }
    }
  }
  return
}

// -----

func.func @group_c2() {
  // expected-error@+1 {{(C2) expects one 'warp.threads'}}
  warp.group {
  }
  return
}

// -----

func.func @threads_c1_rank() {
  warp.group {
    // expected-error@+1 {{(C1) expects at most 4 indices, but got 5}}
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%a: i32, %b: i32, %c: i32, %d: i32, %e: i32):
      warp.yield
    }
  }
  return
}

// -----

func.func @threads_c1_type() {
  warp.group {
    // expected-error@+1 {{(C1) expects indices of type i32, but got 'i64'}}
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i64):
      warp.yield
    }
  }
  return
}

// -----

func.func @threads_c1_mask() {
  warp.group {
    // expected-error@+1 {{(C1) expects a mask of 8 lanes, but got 'vector<4xi1>'}}
    warp.threads attributes {kinds = array<i32>, lanes = 8 : i64, types = []} {
    ^bb0(%i: i32, %m: vector<4xi1>):
      warp.yield
    }
  }
  return
}

// -----

func.func @threads_c2() {
  warp.group {
    // expected-error@+1 {{(C2) expects as many kinds, types and results as values that are yielded}}
    %0 = warp.threads attributes {kinds = array<i32: 0>, types = [si32]} {
    ^bb0(%i: i32):
      warp.yield
    } : i32
  }
  return
}

// -----

func.func @threads_c3() {
  warp.group {
    // expected-error@+1 {{(C3) combines 'f32', but yields 'i32' and results in 'i32'}}
    %0 = warp.threads attributes {kinds = array<i32: 0>, types = [f32]} {
    ^bb0(%i: i32):
      warp.yield %i : i32
    } : i32
  }
  return
}

// -----

func.func @threads_c3_lanes() {
  warp.group {
    // expected-error@+1 {{(C3) combines 'si32', but yields 'i32' and results in 'i32'}}
    %0 = warp.threads attributes {
        kinds = array<i32: 0>, lanes = 4 : i64, types = [si32]} {
    ^bb0(%i: i32, %m: vector<4xi1>):
      warp.yield %i : i32
    } : i32
  }
  return
}

// -----

func.func @once_c1_threads() {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      // expected-error@+1 {{(C1) expects to stand in a 'warp.group', outside of its threads}}
      warp.once {
      }
      warp.yield
    }
  }
  return
}

// -----

func.func @once_c1_function() {
  // expected-error@+1 {{(C1) expects to stand in a 'warp.group', outside of its threads}}
  warp.once {
  }
  return
}

// -----

func.func @each_lane_c1_arguments(%m: vector<4xi1>, %v: vector<4xf32>) {
  // expected-error@+1 {{(C1) expects an argument for each operand}}
  warp.each_lane %m (%v) {
    warp.yield
  } : vector<4xi1>, vector<4xf32>
  return
}

// -----

func.func @each_lane_c1_argument(%m: vector<4xi1>, %v: vector<4xf32>) {
  // expected-error@+1 {{(C1) has an argument 'f64' for an operand 'vector<4xf32>'}}
  warp.each_lane %m (%v) {
  ^bb0(%x: f64):
    warp.yield
  } : vector<4xi1>, vector<4xf32>
  return
}

// -----

func.func @each_lane_c1_results(%m: vector<4xi1>, %v: vector<4xf32>) {
  // expected-error@+1 {{(C1) expects to yield a value for each result}}
  %0 = warp.each_lane %m (%v) {
  ^bb0(%x: f32):
    warp.yield
  } : vector<4xi1>, vector<4xf32> -> vector<4xf32>
  return
}

// -----

func.func @each_lane_c1_result(%m: vector<4xi1>, %v: vector<4xf32>) {
  // expected-error@+1 {{(C1) yields 'f32' for a result 'vector<8xf32>'}}
  %0 = warp.each_lane %m (%v) {
  ^bb0(%x: f32):
    warp.yield %x : f32
  } : vector<4xi1>, vector<4xf32> -> vector<8xf32>
  return
}

// -----

func.func @load_lanes_c1(%a: !warp.array<2 x f32>, %i: i32, %m: vector<4xi1>) {
  // expected-error@+1 {{(C1) expects 2 indices for '!warp.array<2 x f32>', but got 1}}
  %0 = warp.load_lanes unit %a[%i] mask %m {nonNegative = array<i1: true>}
    : !warp.array<2 x f32>, (i32), vector<4xi1> -> vector<4xf32>
  return
}

// -----

func.func @load_lanes_c2_count(%a: !warp.array<1 x !warp.vec<2 x f32>>,
                               %i: i32, %m: vector<4xi1>) {
  // expected-error@+1 {{(C2) expects 2 components for '!warp.array<1 x !warp.vec<2 x f32>>', but got 1}}
  %0 = warp.load_lanes unit %a[%i] mask %m {nonNegative = array<i1: true>}
    : !warp.array<1 x !warp.vec<2 x f32>>, (i32), vector<4xi1> -> vector<4xf32>
  return
}

// -----

func.func @load_lanes_c2_type(%a: !warp.array<1 x ui32>, %i: i32,
                              %m: vector<4xi1>) {
  // expected-error@+1 {{(C2) expects a component of 4 lanes of 'i32', but got 'vector<4xf32>'}}
  %0 = warp.load_lanes unit %a[%i] mask %m {nonNegative = array<i1: true>}
    : !warp.array<1 x ui32>, (i32), vector<4xi1> -> vector<4xf32>
  return
}

// -----

func.func @store_lanes_c1(%a: !warp.array<1 x f32>, %i: i32, %m: vector<4xi1>,
                          %v: vector<4xf32>) {
  // expected-error@+1 {{(C1) expects 1 indices for '!warp.array<1 x f32>', but got 2}}
  warp.store_lanes unit(%v), %a[%i, %i] mask %m {nonNegative = array<i1: true>}
    : (vector<4xf32>), !warp.array<1 x f32>, (i32, i32), vector<4xi1>
  return
}

// -----

func.func @store_lanes_c2(%a: !warp.array<1 x f32>, %i: i32, %m: vector<4xi1>,
                          %v: vector<8xf32>) {
  // expected-error@+1 {{(C2) expects a component of 4 lanes of 'f32', but got 'vector<8xf32>'}}
  warp.store_lanes unit(%v), %a[%i] mask %m {nonNegative = array<i1: true>}
    : (vector<8xf32>), !warp.array<1 x f32>, (i32), vector<4xi1>
  return
}

// -----

func.func @parameter_c1(%block: !llvm.ptr) {
  // expected-error@+1 {{expects an offset of 0 or more, but got -8}}
  %0 = warp.parameter %block[-8] : !llvm.ptr -> f32
  return
}

// -----

func.func @parameter_c2(%block: !llvm.ptr) {
  // expected-error@+1 {{expects an array to be packed, but got 'f32'}}
  %0 = warp.parameter %block[8] packed : !llvm.ptr -> f32
  return
}
