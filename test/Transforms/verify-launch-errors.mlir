// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-verify-launch

// Conversions that saturate are intrinsics; other operations of the LLVM
// dialect come with the entry.
func.func @llvm(%x: f32) attributes {warp.kernel} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      %0 = llvm.call_intrinsic "llvm.fptosi.sat.i32.f32"(%x) : (f32) -> i32
      // expected-error @below {{operation 'llvm.mlir.poison' is not part of phase 'launch'}}
      %1 = llvm.mlir.poison : f32
      warp.yield
    }
  }
  return
}

// -----

// Indices are arguments of the region.
func.func @tid() attributes {warp.kernel} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      // expected-error @below {{operation 'warp.tid' is not part of phase 'launch'}}
      %0 = warp.tid : i32
      warp.yield
    }
  }
  return
}

// -----

func.func @types(%x: f32) attributes {warp.kernel} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      // expected-error @below {{type 'vector<2x2xf32>' is not part of phase 'launch'}}
      %0 = arith.constant dense<0.0> : vector<2x2xf32>
      warp.yield
    }
  }
  return
}

// -----

// expected-error @below {{expects one 'warp.group', but got 0}}
func.func @none(%x: f32) attributes {warp.kernel} {
  return
}

// -----

// expected-error @below {{expects one 'warp.group', but got 2}}
func.func @two() attributes {warp.kernel} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.yield
    }
  }
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.yield
    }
  }
  return
}

// -----

func.func @outside(%x: f32) attributes {warp.kernel} {
  // expected-error @below {{expects to stand in the 'warp.group'}}
  %0 = arith.addf %x, %x : f32
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.yield
    }
  }
  return
}

// -----

// An operation with effects runs once, or in each thread; the condition may be
// asked.
func.func @effects(%x: !warp.array<1 x f32>, %b: i1, %a: f32)
    attributes {warp.kernel} {
  warp.group {
    warp.threads attributes {kinds = array<i32>, types = []} {
    ^bb0(%i: i32):
      warp.store_components(%a), %x[%i] : (f32), !warp.array<1 x f32>, i32
      warp.yield
    }
    scf.if %b {
      %c0 = arith.constant 0 : i32
      warp.once {
        warp.store_components(%a), %x[%c0] : (f32), !warp.array<1 x f32>, i32
      }
      // expected-error @below {{expects to stand in 'warp.threads' or 'warp.once', as it has effects}}
      warp.store_components(%a), %x[%c0] : (f32), !warp.array<1 x f32>, i32
    }
  }
  return
}
