// RUN: warp-opt %s --split-input-file --verify-diagnostics --warp-differentiate-kernel=mode=winners

// Values that the launch changed cannot be read again.
func.func @overwritten(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  // expected-error @+1 {{but this reads 'argument 0', which the launch changes; use two launches}}
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %o = warp.atomic max %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  // expected-note @+1 {{changed here}}
  warp.store %v, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// The old value is that of some thread.
func.func @returned(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                    %z: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-error @+1 {{but what this atomic returns depends on the order of threads}}
  %o = warp.atomic max %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  warp.store %o, %z[%i] : f32, !warp.array<1 x f32>, si32
  return
}

// -----

// True if the sum comes before or after the minimum is not known.
func.func @mixed(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-error @+1 {{but 'argument 1' is changed in another way, too}}
  %o = warp.atomic min %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  // expected-note @+1 {{changed here}}
  %p = warp.atomic add %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}

// -----

// A read element may be a written element.
func.func @chosen(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %c: i1)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %zero = warp.constant 0 : si32
  %a = scf.if %c -> !warp.array<1 x f32> {
    scf.yield %x : !warp.array<1 x f32>
  } else {
    scf.yield %y : !warp.array<1 x f32>
  }
  // expected-error @+1 {{but which array this accesses is not known}}
  %v = warp.load %a[%i] : !warp.array<1 x f32>, si32 -> f32
  %o = warp.atomic max %v, %y[%zero] : f32, !warp.array<1 x f32>, si32 -> f32
  return
}
