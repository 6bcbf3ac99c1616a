// RUN: warp-opt %s --warp-lower-math | FileCheck %s --check-prefix=CPU
// RUN: sed 's/= #cpu/= #gpu/' %s | warp-opt --warp-lower-math | FileCheck %s --check-prefix=GPU
// RUN: sed 's/= #cpu/= #fast/' %s | warp-opt --warp-lower-math | FileCheck %s --check-prefix=FAST

#cpu = #warp.variant<target = <name = "cpu", bits = 128>>
#gpu = #warp.variant<target = <name = "sm_90">>
#fast = #warp.variant<target = <name = "sm_90">,
      fast_math = true>

// Functions have no effects, so that LLVM may move and merge calls.
// CPU: llvm.func @warp_pow(f64, f64) -> f64 attributes {memory_effects = #llvm.memory_effects<other = none
// CPU: llvm.func @warp_erff(f32) -> f32
// CPU: llvm.func @warp_sin(f64) -> f64
// CPU: llvm.func @warp_sinf(f32) -> f32

// CPU-LABEL: llvm.func @calls
// CPU: llvm.call @warp_sinf
// CPU: llvm.call @warp_sin(
// CPU: llvm.call @warp_erff
// CPU: %[[WIDE:.*]] = arith.extf %{{.*}} : f16 to f32
// CPU: %[[SINE:.*]] = llvm.call @warp_sinf(%[[WIDE]])
// CPU: arith.truncf %[[SINE]] : f32 to f16
// CPU: math.sqrt
// CPU: math.rsqrt
// CPU: arith.remf
// CPU: llvm.call @warp_pow(

// GPU-LABEL: llvm.func @calls
// GPU: llvm.call @warp_gpu_sinf
// GPU: llvm.call @__nv_sin(
// GPU: llvm.call @__nv_erff
// GPU: math.sqrt
// GPU: llvm.call @__nv_rsqrtf
// GPU: llvm.call @__nv_fmodf
// GPU: llvm.call @__nv_pow(

// FAST-LABEL: llvm.func @calls
// FAST: llvm.call @__nv_fast_sinf
// FAST: llvm.call @__nv_sin(
llvm.func @calls(%x: f32, %y: f64, %h: f16, %n: i32)
    attributes {warp.entry, warp.variant = #cpu} {
  %0 = math.sin %x : f32
  %1 = math.sin %y : f64
  %2 = math.erf %x : f32
  %3 = math.sin %h : f16
  %4 = math.sqrt %x : f32
  %5 = math.rsqrt %x : f32
  %6 = arith.remf %x, %x : f32
  %7 = math.fpowi %x, %n : f32, i32
  llvm.return
}

// The call gets the operands themselves, other selects stay.
// CPU-LABEL: llvm.func @call
// CPU-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[C:.*]]: i1)
// CPU: llvm.call @warp_atan2f(%[[Y]], %[[X]])
// CPU: %[[CHOSEN:.*]] = arith.select
// CPU: llvm.call @warp_atan2f(%[[Y]], %[[CHOSEN]])
llvm.func @call(%x: f32, %y: f32, %c: i1)
    attributes {warp.variant = #cpu} {
  %side = math.copysign %y, %x : f32
  %guard = arith.select %c, %side, %x {warp.angle_guard} : f32
  %a = math.atan2 %y, %guard : f32
  %chosen = arith.select %c, %side, %x : f32
  %b = math.atan2 %y, %chosen : f32
  llvm.return
}

// Sine and cosine of one float are one call where the first is always computed
// before the second.
// CPU-LABEL: llvm.func @angles
// CPU: llvm.call @warp_sinf
// CPU: llvm.call @warp_cosf
// GPU-LABEL: llvm.func @angles
// GPU-SAME: (%[[X:.*]]: f32, %[[Y:.*]]: f32, %[[C:.*]]: i1)
// GPU: %[[PAIR:.*]] = llvm.call @warp_gpu_sincosf(%[[X]]) : (f32) -> vector<2xf32>
// GPU: %[[SINE:.*]] = llvm.extractelement %[[PAIR]]
// GPU: %[[COSINE:.*]] = llvm.extractelement %[[PAIR]]
// GPU: scf.if
// GPU: llvm.call @warp_gpu_cosf(%[[Y]])
// GPU: llvm.call @warp_gpu_sinf(%[[Y]])
// GPU-NOT: llvm.call
// GPU: arith.addf %[[SINE]], %[[COSINE]]
// FAST-LABEL: llvm.func @angles
// FAST: llvm.call @__nv_fast_sinf
// FAST: llvm.call @__nv_fast_cosf
llvm.func @angles(%x: f32, %y: f32, %c: i1) -> f32
    attributes {warp.variant = #cpu} {
  %0 = math.sin %x : f32
  %1 = scf.if %c -> f32 {
    %4 = math.cos %y : f32
    scf.yield %4 : f32
  } else {
    %5 = math.sin %y : f32
    scf.yield %5 : f32
  }
  %2 = math.cos %x : f32
  %3 = arith.addf %0, %2 : f32
  %6 = arith.addf %1, %3 : f32
  llvm.return %6 : f32
}
