// Quickly compiled code for GPUs calls the long functions of the device library,
// and what these need, which are linked as machine code. It has whatever
// registers they have.
//
// RUN: warp-opt %s --warp-emit=ptx \
// RUN:   --warp-options="target=sm_90a,linked=true" | FileCheck %s

// CHECK-DAG: .extern .func warp_group_root
// CHECK-DAG: .extern .func warp_mesh_ray
// CHECK: .entry cast
// CHECK-NOT: .maxnreg
// CHECK: griddepcontrol.wait
// CHECK: call.uni warp_group_root,
// CHECK: call.uni warp_mesh_ray,
// CHECK-NOT: {{^}}.func
func.func @cast(%mesh: ui64, %x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %root = warp.constant -1 : si32
  %group = warp.constant 3 : si32
  %far = warp.constant 1.0e+03 : f32
  %zero = warp.constant 0.0 : f32
  %from = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %place = warp.library_call "warp_group_root"(%mesh, %group) : (ui64, si32) -> si32
  %hit:4 = warp.library_call "warp_mesh_ray"(%mesh, %from, %zero, %zero, %zero, %zero, %far, %far, %place)
      : (ui64, f32, f32, f32, f32, f32, f32, f32, si32) -> (si32, f32, f32, f32)
  warp.store %hit#3, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
}
