//===- library-levels-test.cpp - Machine code of the device library -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The library's searches are compiled for several levels of x86-64; kernels for
// a processor call those of its level. All of them find the same, bit for bit.
//
//===----------------------------------------------------------------------===//

#include "GeometryScenes.h"
#include "warp/Compile.h"
#include "warp/Launch.h"

#include <cstring>
#include <gtest/gtest.h>

using namespace warp;

namespace {

/// A closest point with its side, a ray, a winding number, exact orientation.
const char kernel[] = R"(
func.func @k(%mesh: ui64, %x: !warp.array<1 x !warp.vec<3 x f32>>,
            %found: !warp.array<2 x f32>) attributes {warp.kernel} {
  %zero = warp.constant 0 : si32
  %one = warp.constant 1 : si32
  %two = warp.constant 2 : si32
  %three = warp.constant 3 : si32
  %four = warp.constant 4 : si32
  %five = warp.constant 5 : si32
  %six = warp.constant 6 : si32
  %root = warp.constant -1 : si32
  %far = warp.constant 1.0e+06 : f32
  %epsilon = warp.constant 1.0e-03 : f32
  %half = warp.constant 5.0e-01 : f32
  %accuracy = warp.constant 2.0 : f32
  %i = warp.tid : si32
  %p = warp.load %x[%i] : !warp.array<1 x !warp.vec<3 x f32>>, si32 -> !warp.vec<3 x f32>
  %px = warp.extract %p[%zero] : !warp.vec<3 x f32>, si32 -> f32
  %py = warp.extract %p[%one] : !warp.vec<3 x f32>, si32 -> f32
  %pz = warp.extract %p[%two] : !warp.vec<3 x f32>, si32 -> f32
  %near:4 = warp.library_call "warp_mesh_closest_signed"(%mesh, %px, %py, %pz, %far, %epsilon)
      : (ui64, f32, f32, f32, f32, f32) -> (si32, f32, f32, f32)
  %hit:4 = warp.library_call "warp_mesh_ray"(%mesh, %px, %py, %pz, %pz, %px, %py, %far, %root)
      : (ui64, f32, f32, f32, f32, f32, f32, f32, si32) -> (si32, f32, f32, f32)
  %side = warp.library_call "warp_mesh_side_winding"(%mesh, %px, %py, %pz, %accuracy, %half)
      : (ui64, f32, f32, f32, f32, f32) -> f32
  %dx = warp.cast %px : f32 to f64
  %dy = warp.cast %py : f32 to f64
  %turn = warp.library_call "warp_orient2d"(%dx, %dy, %dy, %dx, %dx, %dx)
      : (f64, f64, f64, f64, f64, f64) -> si32
  %turned = warp.cast %turn : si32 to f32
  warp.store %near#1, %found[%i, %zero] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %near#2, %found[%i, %one] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %near#3, %found[%i, %two] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %hit#1, %found[%i, %three] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %hit#3, %found[%i, %four] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %side, %found[%i, %five] : f32, !warp.array<2 x f32>, si32, si32
  warp.store %turned, %found[%i, %six] : f32, !warp.array<2 x f32>, si32, si32
  return
}
)";

constexpr int threads = 500, numbers = 7;

struct Block {
  LaunchHeader header;
  uint64_t mesh;
  ArrayDescriptor x, found;
};

std::vector<float> run(const std::string &target, uint64_t mesh,
                       std::vector<scenes::Vertex> &x) {
  CompileOptions options;
  options.target = target;
  options.packed = options.nonNegative = 6;
  void *entry = Jit::get().load(compile(Module::fromText(kernel), options));
  std::vector<float> found(threads * numbers, -7.0f);
  Block block{{}, mesh, {}, {}};
  block.x.data = x.data();
  block.x.shape[0] = threads;
  block.x.strides[0] = sizeof(scenes::Vertex);
  block.x.ndim = 1;
  block.found.data = found.data();
  block.found.shape[0] = threads;
  block.found.shape[1] = numbers;
  block.found.strides[0] = numbers * sizeof(float);
  block.found.strides[1] = sizeof(float);
  block.found.ndim = 2;
  block.header.dim[0] = threads;
  reinterpret_cast<CpuEntry>(entry)(&block, 0, threads);
  Jit::get().unload(entry);
  return found;
}

} // namespace

TEST(LibraryLevels, FindTheSame) {
  scenes::Scene scene = scenes::makeSphere(40, 20);
  Mesh mesh(scene.arrays(), -1, BvhConstructor::Sah, /*hasWinding=*/true);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> around(-1.3f, 1.3f);
  std::vector<scenes::Vertex> x(threads);
  for (scenes::Vertex &one : x)
    one = {around(random), around(random), around(random)};
  std::vector<float> host = run("cpu", mesh.id(), x);
  int inside = 0;
  for (int i = 0; i < threads; ++i) {
    inside += host[i * numbers + 5] < 0;
    // The two ways to know the side agree.
    EXPECT_EQ(host[i * numbers + 2] < 0, host[i * numbers + 5] < 0) << i;
  }
  EXPECT_GT(inside, threads / 10);
  std::vector<std::string> targets{"cpu:x86-64", "cpu:x86-64-v2"};
  for (const char *level : {"x86-64-v3", "x86-64-v4"})
    if (std::string(level) == "x86-64-v3" ? __builtin_cpu_supports("x86-64-v3")
                                          : __builtin_cpu_supports("x86-64-v4"))
      targets.push_back(std::string("cpu:") + level);
  for (const std::string &target : targets) {
    std::vector<float> same = run(target, mesh.id(), x);
    EXPECT_EQ(
        std::memcmp(same.data(), host.data(), host.size() * sizeof(float)), 0)
        << target;
  }
}
