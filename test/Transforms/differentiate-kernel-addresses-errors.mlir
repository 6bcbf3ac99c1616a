// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel=active=1 --verify-diagnostics
// RUN: warp-opt %s --split-input-file --warp-differentiate-kernel="mode=forward active=1" --verify-diagnostics

// A write would have to take the gradient from an address that may be none.
func.func @write(%at: ui64, %grad: ui64, %n: si32, %x: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %a = warp.array_at %at[%n] grad(%grad : ui64) : ui64, si32 -> !warp.array<1 x f32>
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  // expected-error@+1 {{cannot write through an address: memory with gradients is read-only in a differentiated kernel}}
  warp.store %v, %a[%i] : f32, !warp.array<1 x f32>, si32
  return
}
