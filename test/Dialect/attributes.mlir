// RUN: warp-opt %s --verify-roundtrip | FileCheck %s
// RUN: warp-opt %s --warp-pipeline="to-thread target=sm_90 rank=2 packed=1 non-negative=2 index32=false flat large disjoint debug fast-math deterministic block-dim=64 threads=4 min-blocks=2" | FileCheck %s --check-prefix=ALL
// RUN: %if x86-64 %{ warp-opt %s --warp-pipeline="to-thread target=cpu:x86-64-v3 deterministic ordered lanes=8" | FileCheck %s --check-prefix=V3 %}
// RUN: warp-opt %s --warp-pipeline="to-thread target=cpu:x86-64-v2" | FileCheck %s --check-prefix=V2
// RUN: %if x86-64 %{ warp-opt %s --warp-pipeline="to-thread target=cpu:znver5" | FileCheck %s --check-prefix=ZEN %}
// RUN: warp-opt %s --warp-pipeline=to-thread | FileCheck %s --check-prefix=KEPT

// Default values are not printed; a variant that a kernel has stays unless
// options are given, and those can ask for all that the runtime can.
// CHECK: func.func @f()
// CHECK-SAME: warp.schedule = #warp.schedule<coarsening = 4, cost = 7, exclusive = true, sums = [#warp.summed_array<width = 32, descriptor = 24, element_size = 4>, #warp.summed_array<descriptor = 80, gradient = true, element_size = 12, stride_scale = 2>]>
// CHECK-SAME: warp.variant = #warp.variant<target = <name = "cpu:znver5", bits = 512>, deterministic = true, ordered = true, rank = 3>
// ALL: warp.variant = #warp.variant<target = <name = "sm_90">, block_dim = 64, debug = true, deterministic = true, disjoint = true, fast_math = true, flat = true, index32 = false, large = true, min_blocks = 2, non_negative = 2, packed = 1, rank = 2, threads = 4>
// V3: warp.variant = #warp.variant<target = <name = "cpu:x86-64-v3", bits = 256>, deterministic = true, lanes = 8, ordered = true>
// V2: warp.variant = #warp.variant<target = <name = "cpu:x86-64-v2", bits = 128>>
// ZEN: warp.variant = #warp.variant<target = <name = "cpu:znver5", bits = 512>>
// KEPT: warp.variant = #warp.variant<target = <name = "cpu:znver5", bits = 512>, deterministic = true, ordered = true, rank = 3>
func.func @f() attributes {
    warp.kernel,
    warp.variant = #warp.variant<rank = 3, deterministic = true, ordered = true,
        target = <name = "cpu:znver5", bits = 512>,
        threads = 16>,
    warp.schedule = #warp.schedule<coarsening = 4, exclusive = true, cost = 7, sums = [
        #warp.summed_array<width = 32, descriptor = 24, element_size = 4>,
        #warp.summed_array<descriptor = 80, gradient = true, element_size = 12,
                           stride_scale = 2>]>} {
  return
}

// CHECK: func.func private @hidden(!warp.array<1 x f32> {warp.hidden = #warp.hidden<kind = tangent, leaf = 0, direction = 1>}
// CHECK-SAME: !warp.array<1 x si32> {warp.hidden = #warp.hidden<kind = counters, places = ["k.py:1"]>})
func.func private @hidden(
    !warp.array<1 x f32> {warp.hidden = #warp.hidden<kind = tangent, leaf = 0,
      direction = 1>},
    !warp.array<1 x si32> {warp.hidden = #warp.hidden<kind = counters,
      leaf = -1, places = ["k.py:1"]>})
