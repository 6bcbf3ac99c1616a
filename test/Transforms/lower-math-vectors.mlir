// RUN: warp-opt %s --warp-lower-math | FileCheck %s
// RUN: warp-opt %s --warp-lower-math --warp-convert-to-llvm | FileCheck %s --check-prefix=LLVM

#cpu = #warp.variant<target = <name = "cpu", bits = 256>>

// A function of ours takes the vector; half precision computes in f32.
// CHECK-LABEL: llvm.func @whole
// CHECK: llvm.call @warp_sinf_x16(%{{.*}}) : (vector<16xf32>) -> vector<16xf32>
// CHECK: llvm.call @warp_powf_x8(
// CHECK: llvm.call @warp_expf_x4(
// CHECK: %[[WIDE:.*]] = arith.extf %{{.*}} : vector<4xf16> to vector<4xf32>
// CHECK: %[[LOG:.*]] = llvm.call @warp_logf_x4(%[[WIDE]])
// CHECK: arith.truncf %[[LOG]] : vector<4xf32> to vector<4xf16>
// CHECK: llvm.call @warp_atan2_x8(
// CHECK: llvm.call @warp_cos_x2(
llvm.func @whole(%a: vector<16xf32>, %b: vector<8xf32>, %c: vector<4xf32>,
                 %d: vector<4xf16>, %e: vector<8xf64>, %f: vector<2xf64>)
    attributes {warp.entry, warp.variant = #cpu} {
  %0 = math.sin %a : vector<16xf32>
  %1 = math.powf %b, %b : vector<8xf32>
  %2 = math.exp %c : vector<4xf32>
  %3 = math.log %d : vector<4xf16>
  %4 = math.atan2 %e, %e : vector<8xf64>
  %5 = math.cos %f : vector<2xf64>
  llvm.return
}

// Wider vectors are halved.
// CHECK-LABEL: llvm.func @halves
// CHECK: %[[LOW:.*]] = llvm.shufflevector %{{.*}} [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]
// CHECK: %[[A:.*]] = llvm.call @warp_sinf_x16(%[[LOW]])
// CHECK: %[[HIGH:.*]] = llvm.shufflevector %{{.*}} [16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30, 31]
// CHECK: %[[B:.*]] = llvm.call @warp_sinf_x16(%[[HIGH]])
// CHECK: llvm.shufflevector %[[A]], %[[B]] [0, 1, {{.*}}, 31] : vector<16xf32>
llvm.func @halves(%a: vector<32xf32>) attributes {warp.variant = #cpu} {
  %0 = math.sin %a : vector<32xf32>
  llvm.return
}

// Narrow vectors, and those of an odd length, are called lane by lane.
// CHECK-LABEL: llvm.func @lanes
// CHECK: %[[X:.*]] = llvm.extractelement %{{.*}} : vector<2xf32>
// CHECK: %[[Y:.*]] = llvm.call @warp_sinf(%[[X]])
// CHECK: llvm.insertelement %[[Y]]
// CHECK: llvm.call @warp_sinf(
// CHECK-COUNT-3: llvm.call @warp_erf(
// CHECK: llvm.return
llvm.func @lanes(%a: vector<2xf32>, %b: vector<3xf64>)
    attributes {warp.variant = #cpu} {
  %0 = math.sin %a : vector<2xf32>
  %1 = math.erf %b : vector<3xf64>
  llvm.return
}

// Operations that stay have vector forms in LLVM.
// LLVM-LABEL: llvm.func @native
// LLVM: llvm.intr.sqrt(%{{.*}}) : (vector<16xf32>) -> vector<16xf32>
// LLVM: llvm.fdiv %{{.*}} : vector<16xf32>
// LLVM: llvm.frem %{{.*}} : vector<16xf32>
// LLVM: llvm.intr.floor(
// LLVM: llvm.intr.fma(
// LLVM-NOT: math.
llvm.func @native(%a: vector<16xf32>) attributes {warp.variant = #cpu} {
  %0 = math.rsqrt %a : vector<16xf32>
  %1 = arith.remf %0, %a : vector<16xf32>
  %2 = math.floor %1 : vector<16xf32>
  %3 = math.fma %0, %1, %2 : vector<16xf32>
  llvm.return
}

// An integer power is a power of doubles.
// LLVM-LABEL: llvm.func @power
// LLVM: llvm.fpext %{{.*}} : vector<4xf32> to vector<4xf64>
// LLVM: llvm.sitofp %{{.*}} : vector<4xi32> to vector<4xf64>
// LLVM: llvm.call @warp_pow_x4(
// LLVM: llvm.fptrunc %{{.*}} : vector<4xf64> to vector<4xf32>
llvm.func @power(%a: vector<4xf32>, %n: vector<4xi32>)
    attributes {warp.variant = #cpu} {
  %0 = math.fpowi %a, %n : vector<4xf32>, vector<4xi32>
  llvm.return
}
