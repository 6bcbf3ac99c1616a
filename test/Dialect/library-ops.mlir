// RUN: warp-opt %s | warp-opt | FileCheck %s
// RUN: warp-opt %s --warp-lower-composites | FileCheck %s --check-prefix=THREAD

// Calls of the device library survive a round trip, and lose signs in thread IR.
// CHECK-LABEL: func.func @closest
// THREAD-LABEL: func.func @closest
func.func @closest(%mesh: ui64, %x: f32, %out: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  // CHECK: warp.library_call "warp_mesh_closest"(%{{.*}}) : (ui64, f32, f32, f32, f32) -> (si32, f32, f32)
  // THREAD: warp.library_call "warp_mesh_closest"(%{{.*}}) : (i64, f32, f32, f32, f32) -> (i32, f32, f32)
  %face, %u, %v = warp.library_call "warp_mesh_closest"(%mesh, %x, %x, %x, %x)
      : (ui64, f32, f32, f32, f32) -> (si32, f32, f32)
  %y = warp.load %out[%face] : !warp.array<1 x f32>, si32 -> f32
  warp.store %y, %out[%face] : f32, !warp.array<1 x f32>, si32
  return
}

// Native code may give several numbers, and stays where nobody uses them if it
// changes memory.
// CHECK-LABEL: func.func @native
// THREAD-LABEL: func.func @native
func.func @native(%x: !warp.array<1 x f32>, %a: f32) attributes {warp.kernel} {
  // CHECK: warp.library_call "warp_native_memory_0"(%{{.*}}) : (ui64, f32) -> (f32, si32)
  // THREAD: warp.library_call "warp_native_memory_0"(%{{.*}}) : (i64, f32) -> (f32, i32)
  %p = warp.pointer %x : !warp.array<1 x f32> -> ui64
  %0, %1 = warp.library_call "warp_native_memory_0"(%p, %a)
      : (ui64, f32) -> (f32, si32)
  return
}
