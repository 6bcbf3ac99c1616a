//===- older-processors-test.cpp - The same bits with fewer features ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code for a processor without AVX-512, or without fma, can run here, too:
// results must be those of the host's code, bit for bit, with any number of
// lanes.
//
//===----------------------------------------------------------------------===//

#include "warp/Compile.h"
#include "warp/Launch.h"

#include <cstring>
#include <gtest/gtest.h>
#include <random>
#include <vector>

using namespace warp;

namespace {

/// A gather, a loop that threads leave one by one, products that become fma,
/// functions of both widths, a quotient that is zero in some, a branch.
const char kernel[] = R"(
func.func @k(%arg0: !warp.array<1 x !warp.vec<3 x f32>>,
            %arg1: !warp.array<1 x si32>, %arg2: !warp.array<1 x f32>,
            %arg3: !warp.array<1 x f64>, %arg4: si32)
    attributes {warp.kernel} {
  %0 = warp.constant 0 : si32
  %1 = warp.constant 1 : si32
  %2 = warp.constant 7 : si32
  %3 = warp.constant 9.000000e+00 : f32
  %4 = warp.constant 1.500000e+00 : f32
  %5 = warp.constant 2 : si32
  %6 = warp.constant 1.000000e-01 : f64
  %7 = warp.constant 1.000000e+00 : f32
  %8 = warp.tid : si32
  %9 = warp.load %arg0[%8] : !warp.array<1 x !warp.vec<3 x f32>>, si32 ->
      !warp.vec<3 x f32>
  %10 = warp.load %arg1[%8] : !warp.array<1 x si32>, si32 -> si32
  %11 = warp.load %arg0[%10] : !warp.array<1 x !warp.vec<3 x f32>>, si32 ->
      !warp.vec<3 x f32>
  %12 = warp.dot(%9, %11) : (!warp.vec<3 x f32>, !warp.vec<3 x f32>) -> f32
  %13 = warp.extract %9[%0] : !warp.vec<3 x f32>, si32 -> f32
  %14 = warp.mul(%12, %13) : (f32, f32) -> f32
  %15 = warp.extract %9[%1] : !warp.vec<3 x f32>, si32 -> f32
  %16 = warp.add(%14, %15) : (f32, f32) -> f32
  %17:2 = scf.while (%arg5 = %16, %arg6 = %0) : (f32, si32) -> (f32, si32) {
    %34 = warp.load %arg1[%8] : !warp.array<1 x si32>, si32 -> si32
    %35 = warp.mod(%34, %2) : (si32, si32) -> si32
    %36 = warp.lt(%arg6, %35) : (si32, si32) -> i1
    %37 = warp.lt(%arg5, %3) : (f32, f32) -> i1
    %38 = warp.bit_and(%36, %37) : (i1, i1) -> i1
    scf.condition(%38) %arg5, %arg6 : f32, si32
  } do {
  ^bb0(%arg5: f32, %arg6: si32):
    %34 = warp.mul(%arg5, %4) : (f32, f32) -> f32
    %35 = warp.extract %9[%5] : !warp.vec<3 x f32>, si32 -> f32
    %36 = warp.cast %arg6 : si32 to f32
    %37 = warp.add(%35, %36) : (f32, f32) -> f32
    %38 = warp.sin(%37) : (f32) -> f32
    %39 = warp.add(%34, %38) : (f32, f32) -> f32
    %40 = warp.add(%arg6, %1) : (si32, si32) -> si32
    scf.yield %39, %40 : f32, si32
  }
  %18 = warp.cast %17#0 : f32 to f64
  %19 = warp.cast %15 : f32 to f64
  %20 = warp.mul(%18, %19) : (f64, f64) -> f64
  %21 = warp.add(%20, %6) : (f64, f64) -> f64
  %22 = warp.neg(%21) : (f64) -> f64
  %23 = warp.mul(%22, %21) : (f64, f64) -> f64
  %24 = warp.exp(%23) : (f64) -> f64
  %25 = warp.abs(%13) : (f32) -> f32
  %26 = warp.pow(%25, %15) : (f32, f32) -> f32
  %27 = warp.cast %26 : f32 to f64
  %28 = warp.add(%24, %27) : (f64, f64) -> f64
  %29 = warp.add(%10, %1) : (si32, si32) -> si32
  %30 = warp.div(%arg4, %29) : (si32, si32) -> si32
  %31 = warp.cast %30 : si32 to f64
  %32 = warp.add(%28, %31) : (f64, f64) -> f64
  warp.store %32, %arg3[%8] : f64, !warp.array<1 x f64>, si32
  %33 = warp.gt(%17#0, %7) : (f32, f32) -> i1
  scf.if %33 {
    %34 = warp.sqrt(%17#0) : (f32) -> f32
    %35 = warp.extract %9[%5] : !warp.vec<3 x f32>, si32 -> f32
    %36 = warp.tanh(%35) : (f32) -> f32
    %37 = warp.div(%36, %17#0) : (f32, f32) -> f32
    %38 = warp.add(%34, %37) : (f32, f32) -> f32
    warp.store %38, %arg2[%8] : f32, !warp.array<1 x f32>, si32
  }
  return
}
)";

struct Block {
  LaunchHeader header;
  ArrayDescriptor x, m, y, z;
  int32_t n;
};

struct Results {
  std::vector<float> y;
  std::vector<double> z;
};

template <class T>
ArrayDescriptor describe(std::vector<T> &data, int components = 1) {
  ArrayDescriptor array;
  array.data = data.data();
  array.shape[0] = static_cast<int32_t>(data.size() / components);
  array.strides[0] = static_cast<int32_t>(components * sizeof(T));
  array.ndim = 1;
  return array;
}

Results run(const std::string &target, int lanes) {
  constexpr int threads = 1003;
  CompileOptions options;
  options.target = target;
  options.packed = options.nonNegative = 15;
  options.lanes = lanes;
  void *entry = Jit::get().load(compile(Module::fromText(kernel), options));
  std::mt19937 random(3);
  std::vector<float> x(3 * threads);
  std::vector<int32_t> m(threads);
  for (float &one : x)
    one = std::uniform_real_distribution<float>(-3, 3)(random);
  for (int32_t &one : m)
    one = std::uniform_int_distribution<int32_t>(0, threads - 1)(random);
  Results results{std::vector<float>(threads, -1.0f),
                  std::vector<double>(threads)};
  Block block{{},
              describe(x, 3),
              describe(m),
              describe(results.y),
              describe(results.z),
              5000};
  block.header.dim[0] = threads;
  reinterpret_cast<CpuEntry>(entry)(&block, 0, threads);
  Jit::get().unload(entry);
  return results;
}

bool sameBits(const Results &a, const Results &b) {
  return std::memcmp(a.y.data(), b.y.data(), a.y.size() * sizeof(float)) == 0 &&
         std::memcmp(a.z.data(), b.z.data(), a.z.size() * sizeof(double)) == 0;
}

} // namespace

TEST(OlderProcessors, GiveTheSameBits) {
  if (!__builtin_cpu_supports("x86-64-v3"))
    GTEST_SKIP() << "the host has no fma";
  Results host = run("cpu", 0);
  EXPECT_NE(host.y[0], host.y[1]);
  std::vector<std::string> targets{"cpu:x86-64", "cpu:x86-64-v2",
                                   "cpu:x86-64-v3"};
  if (__builtin_cpu_supports("x86-64-v4"))
    targets.push_back("cpu:x86-64-v4");
  for (const std::string &target : targets)
    for (int lanes : {0, 1, 4, 8, 16})
      EXPECT_TRUE(sameBits(run(target, lanes), host))
          << target << ", " << lanes;
}
