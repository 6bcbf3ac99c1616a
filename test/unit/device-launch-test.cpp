//===- device-launch-test.cpp - Kernels on every device -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "Runtime/KernelImpl.h"
#include "warp/KernelCache.h"
#include "warp/Runtime.h"

using namespace warp;
using namespace warp::test;

/// y[i] = x[i] + s
static const char *const addText = R"(
module @add {
  func.func @add(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>, %s: f32)
      attributes {warp.arg_names = ["x", "y", "s"], warp.kernel} {
    %i = warp.tid : si32
    %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.add(%v, %s) : (f32, f32) -> f32
    warp.store %w, %y[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
})";

namespace {

struct AddParams {
  LaunchHeader header;
  ArrayDescriptor x, y;
  float s;
};

class DeviceLaunch : public DeviceSuite {
protected:
  void SetUp() override {
    DeviceSuite::SetUp();
    KernelCache::get().setEnabled(false);
  }
  /// The elements of y after a launch over some threads.
  std::vector<float> add(Kernel &kernel, int threads, int count) {
    std::vector<float> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 0.0f);
    Numbers<float> x(number, numbers), y(number, count, -1.0f);
    AddParams params{
        {}, packed(x.data(), {count}, 4), packed(y.data(), {count}, 4), 0.5f};
    LaunchDim dim;
    dim.extent[0] = threads;
    kernel.launch(number, dim, &params);
    return y.get();
  }
};

} // namespace

WARP_TEST_DEVICES(DeviceLaunch);

TEST_P(DeviceLaunch, RunsEveryThread) {
  Kernel kernel(Module::fromText(addText), "add");
  for (int count : {1, 7, 1000, 1000003}) {
    std::vector<float> y = add(kernel, count, count);
    for (int i = 0; runsKernels() && i < count; ++i)
      ASSERT_EQ(y[i], i + 0.5f) << count;
  }
  // Two blocks of 256 threads for each of 132 multiprocessors would do; large
  // launches have several indices for each thread.
  if (!runsKernels())
    EXPECT_NE(lastLaunch().find(" x (256, 1, 1)"), std::string::npos)
        << lastLaunch();
}

TEST_P(DeviceLaunch, OfNoThreadsDoesNothing) {
  Kernel kernel(Module::fromText(addText), "add");
  EXPECT_EQ(add(kernel, 0, 3), std::vector<float>(3, -1.0f));
  EXPECT_TRUE(kernel.compileTimes().empty());
}

TEST_P(DeviceLaunch, OfNegativeExtentsIsAnError) {
  Kernel kernel(Module::fromText(addText), "add");
  EXPECT_THROW(add(kernel, -1, 3), Error);
}

TEST_P(DeviceLaunch, IsRecordedByGraphs) {
  Kernel kernel(Module::fromText(addText), "add");
  add(kernel, 4, 4);
  Numbers<float> x(number, 4, 1.0f), y(number, 4, -1.0f);
  AddParams params{
      {}, packed(x.data(), {4}, 4), packed(y.data(), {4}, 4), 0.5f};
  LaunchDim dim;
  dim.extent[0] = 4;
  std::unique_ptr<Capture> capture = Capture::begin(number);
  kernel.launch(number, dim, &params);
  std::shared_ptr<Graph> graph = capture->end();
  EXPECT_EQ(graph->size(), 1u);
  EXPECT_EQ(y.get(), std::vector<float>(4, -1.0f));
  graph->launch();
  std::vector<float> found = y.get();
  if (runsKernels())
    EXPECT_EQ(found, std::vector<float>(4, 1.5f));
}

TEST_P(DeviceLaunch, OfNonsenseIsACompileError) {
  Kernel::Variant variant;
  variant.key.device = number;
  Code code;
  code.entry = "nothing";
  code.binary.assign(100, 'x');
  EXPECT_THROW(device().load(variant, code), Error);
}
