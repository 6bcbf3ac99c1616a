// REQUIRES: ptxas
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,rank=3 > %t.ptx
// RUN: ptxas -arch=sm_90 %t.ptx -o %t.cubin
// RUN: warp-opt %s --warp-emit=ptx --warp-options=target=sm_90,rank=3,flat,index32=0,debug > %t.flat.ptx
// RUN: ptxas -arch=sm_90 %t.flat.ptx -o %t.cubin

// NVIDIA's assembler takes what we emit: atomics of every width, output,
// bounds checks, library calls.
!a = !warp.array<3 x f32>
func.func @mixed(%a: !a, %h: !warp.array<1 x f16>, %b: !warp.array<1 x bf16>,
                 %n: !warp.array<1 x ui64>, %d: !warp.array<1 x f64>)
    attributes {warp.kernel, warp.arg_names = ["a", "h", "b", "n", "d"]} {
  %i, %j, %k = warp.tid : si32, si32, si32
  %x = warp.load %a[%i, %j, %k] : !a, si32, si32, si32 -> f32
  %y = warp.pow(%x, %x) : (f32, f32) -> f32
  %0 = warp.atomic max %y, %a[%i, %j, %k] : f32, !a, si32, si32, si32 -> f32
  %u = warp.cast %x : f32 to f16
  %1 = warp.atomic add %u, %h[%i] : f16, !warp.array<1 x f16>, si32 -> f16
  %v = warp.cast %x : f32 to bf16
  %2 = warp.atomic min %v, %b[%i] : bf16, !warp.array<1 x bf16>, si32 -> bf16
  %w = warp.cast %x : f32 to ui64
  %3 = warp.atomic max %w, %n[%i] : ui64, !warp.array<1 x ui64>, si32 -> ui64
  %z = warp.cast %x : f32 to f64
  %s = warp.sin(%z) : (f64) -> f64
  %4 = warp.atomic_cas %s, %z, %d[%i]
    : f64, f64, !warp.array<1 x f64>, si32 -> f64
  warp.printf "%d %f\0A"(%i, %s) : si32, f64
  return
}
