// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90 | FileCheck %s
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_80 | FileCheck %s --check-prefix=OLD

// A launch may start a kernel before the one before it has ended: nothing comes
// before the wait for that. Older GPUs do not know it.
// CHECK-LABEL: .visible .entry scale(
// CHECK: {{^[{]$}}
// CHECK-NEXT: griddepcontrol.wait;
// CHECK-NOT: griddepcontrol
// OLD-LABEL: .visible .entry scale(
// OLD-NOT: griddepcontrol
func.func @scale(%x: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x"]} {
  %i = warp.tid : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %b = warp.add(%a, %a) : (f32, f32) -> f32
  warp.store %b, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
