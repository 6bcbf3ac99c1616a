//===- saved-module-test.cpp - Kernels from files, without their source ---===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Array.h"
#include "warp/Runtime.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <string>
#include <vector>

using namespace warp;

/// y[i] = x[i + shift] + s
static const char *const addText = R"(
module @add {
  func.func @add(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>,
                 %shift: si32, %s: f32)
      attributes {warp.arg_names = ["x", "y", "shift", "s"], warp.kernel} {
    %i = warp.tid : si32
    %j = warp.add(%i, %shift) : (si32, si32) -> si32
    %v = warp.load %x[%j] : !warp.array<1 x f32>, si32 -> f32
    %w = warp.add(%v, %s) : (f32, f32) -> f32
    warp.store %w, %y[%i] : f32, !warp.array<1 x f32>, si32
    return
  }
})";

namespace {

class SavedModuleTest : public testing::Test {
protected:
  void SetUp() override { KernelCache::get().setEnabled(false); }

  SavedModule saved(int arch = 0, KernelOptions options = {}) {
    Kernel kernel(Module::fromText(addText), "add", options);
    SavedModule module;
    module.name = "test";
    module.kernels.push_back(kernel.save(arch));
    return module;
  }

  template <typename Fn> std::string errorOf(Fn &&fn) {
    try {
      fn();
    } catch (const Error &error) {
      return error.message;
    }
    return "no error";
  }
};

} // namespace

TEST_F(SavedModuleTest, RunsWithoutItsSource) {
  std::string bytes = saved().bytes();
  SavedModule module = SavedModule::fromBytes(bytes, "here");
  EXPECT_EQ(module.name, "test");
  EXPECT_EQ(module.kernelNames(), std::vector<std::string>{"add"});
  auto kernel = module.kernel("add");
  EXPECT_EQ(kernel, module.kernel("add"));
  EXPECT_EQ(kernel->parameters()[2].type, "si32");
  const int64_t count = 100000;
  std::vector<float> x(2 * count), y(count);
  for (size_t i = 0; i < x.size(); ++i)
    x[i] = float(i);
  // Packed and strided arrays, positive and negative shifts.
  launch(*kernel, cpuDevice, {count}, view(x.data(), {count}),
         view(y.data(), {count}), 0, 0.5f);
  EXPECT_EQ(y[777], 777.5f);
  launch(*kernel, cpuDevice, {count}, view(x.data(), {count}, {2}),
         view(y.data(), {count}), 0, 0.5f);
  EXPECT_EQ(y[777], 1554.5f);
  launch(*kernel, cpuDevice, {1}, view(x.data(), {count}),
         view(y.data(), {count}), -1, 0.5f);
  EXPECT_EQ(y[0], float(count - 1) + 0.5f);
  Array<float> owned(cpuDevice, {count});
  owned.copyFrom(x.data());
  launch(*kernel, cpuDevice, {count}, owned, owned, 0, 1.0f);
  owned.copyTo(y.data());
  EXPECT_EQ(y[99], 100.0f);
}

TEST_F(SavedModuleTest, KeepsWhatIsKnownOfAccesses) {
  bool Access::*const facts[] = {&Access::loaded, &Access::stored,
                                 &Access::combined, &Access::fetched,
                                 &Access::watched};
  for (bool Access::*fact : facts) {
    SavedModule module = saved();
    Access &given = module.kernels[0].accesses[0];
    for (bool Access::*other : facts)
      given.*other = other == fact;
    given.line = 7;
    given.gradientSize = 8;
    Access kept =
        SavedModule::fromBytes(module.bytes(), "here").kernels[0].accesses[0];
    for (bool Access::*other : facts)
      EXPECT_EQ(kept.*other, other == fact);
    EXPECT_EQ(kept.line, 7u);
    EXPECT_EQ(kept.gradientSize, 8);
  }
}

/// holder[used[0]++] = i
static const char *const takeText = R"(
module @take {
  func.func @take(%used: !warp.array<1 x si32>, %holder: !warp.array<1 x si32>)
      attributes {warp.arg_names = ["used", "holder"], warp.kernel} {
    %i = warp.tid : si32
    %zero = warp.constant 0 : si32
    %one = warp.constant 1 : si32
    %slot = warp.atomic add %one, %used[%zero]
      : si32, !warp.array<1 x si32>, si32 -> si32
    warp.store %i, %holder[%slot] : si32, !warp.array<1 x si32>, si32
    return
  }
})";

TEST_F(SavedModuleTest, HasCodeForSlotsInOrderAndInAnyOrder) {
  using Turns = std::vector<bool>;
  auto turnsOf = [](int64_t limit, SavedModule &module) {
    KernelOptions options;
    options.orderedSlots = limit;
    Kernel kernel(Module::fromText(takeText), "take", options);
    module.name = "test";
    module.kernels = {kernel.save(0)};
    module = SavedModule::fromBytes(module.bytes(), "here");
    EXPECT_EQ(module.kernels[0].options.orderedSlots, limit);
    Turns turns;
    for (const SavedVariant &variant : module.kernels[0].variants) {
      EXPECT_NE(variant.code.schedule.sizeFacts & threadOrderFact, 0);
      EXPECT_TRUE(variant.code.schedule.exclusive || !variant.threadOrder);
      turns.push_back(variant.threadOrder);
    }
    return turns;
  };
  SavedModule module;
  EXPECT_EQ(turnsOf(0, module), Turns({false, false}));
  EXPECT_EQ(turnsOf(INT64_MAX, module), Turns({true, true}));
  const int64_t most = 50000;
  EXPECT_EQ(turnsOf(most, module), Turns({false, true, false, true}));
  auto kernel = module.kernel("take");
  for (int64_t count : {most, 2 * most}) {
    int32_t used = 0;
    std::vector<int32_t> holder(count);
    launch(*kernel, cpuDevice, {count}, view(&used, {1}),
           view(holder.data(), {count}));
    EXPECT_EQ(used, count);
    if (count != most)
      std::sort(holder.begin(), holder.end());
    for (int64_t i = 0; i < count; ++i)
      ASSERT_EQ(holder[i], i);
  }
}

TEST_F(SavedModuleTest, ChecksArguments) {
  SavedModule module = saved();
  auto kernel = module.kernel("add");
  std::vector<float> x(10);
  std::vector<double> d(10);
  auto ok = view(x.data(), {10});
  EXPECT_EQ(errorOf([&] { launch(*kernel, cpuDevice, {10}, ok, ok, 0); }),
            "launch('add'): expects 4 arguments, but got 3");
  EXPECT_EQ(errorOf([&] { launch(*kernel, cpuDevice, {10}, ok, ok, 0, 1.0); }),
            "launch('add'): argument 's' expects f32, but got f64");
  EXPECT_EQ(errorOf([&] {
              launch(*kernel, cpuDevice, {10}, view(d.data(), {10}), ok, 0,
                     1.0f);
            }),
            "launch('add'): argument 'x' expects !warp.array<1 x f32>, but got "
            "an array with elements of f64");
  EXPECT_EQ(errorOf([&] {
              launch(*kernel, cpuDevice, {10}, ok, view(x.data(), {5, 2}), 0,
                     1.0f);
            }),
            "launch('add'): argument 'y' expects !warp.array<1 x f32>, but got "
            "an array of 2 dimensions");
  EXPECT_EQ(errorOf([&] { launch(*kernel, cpuDevice, {10}, ok, ok, ok, 1); }),
            "launch('add'): argument 'shift' expects si32, but got an array");
  EXPECT_EQ(errorOf([&] { module.kernel("sub"); }),
            "saved module 'test' has no kernel 'sub', it has: 'add'");
}

TEST_F(SavedModuleTest, NamesWhatWasNotSaved) {
  SavedModule module = saved();
  auto kernel = module.kernel("add");
  std::vector<float> x(16);
  auto all = view(x.data(), {16});
  EXPECT_EQ(
      errorOf([&] { launch(*kernel, cpuDevice, {4, 4}, all, all, 0, 1.0f); }),
      "launch('add'): no code was saved for (cpu, 2 dimensions), there is: "
      "(cpu, 1 dimension)");
}

TEST_F(SavedModuleTest, RejectsDamagedFiles) {
  std::string bytes = saved().bytes();
  auto load = [&](const std::string &text) {
    return errorOf([&] { SavedModule::fromBytes(text, "m.warp"); });
  };
  EXPECT_EQ(load(bytes), "no error");
  EXPECT_EQ(load(""), "saved module 'm.warp' is not a saved module");
  EXPECT_EQ(load(bytes.substr(0, bytes.size() - 1)),
            "saved module 'm.warp' is damaged, its checksum does not fit");
  std::string other = bytes;
  other[8] = 99;
  EXPECT_EQ(load(other), "saved module 'm.warp' has format 99, but this "
                         "release reads format 16, compile it again");
  for (size_t at = 28; at < bytes.size(); at += 997) {
    std::string broken = bytes;
    broken[at] ^= 1;
    EXPECT_EQ(load(broken),
              "saved module 'm.warp' is damaged, its checksum does not fit");
  }
  EXPECT_EQ(errorOf([] { SavedModule::load("/nowhere/m.warp"); }),
            "saved module '/nowhere/m.warp' cannot be read: No such file or "
            "directory");
}

TEST_F(SavedModuleTest, WritesFiles) {
  std::string path = testing::TempDir() + "/saved-module-test.warp";
  saved().save(path);
  EXPECT_EQ(SavedModule::load(path).kernelNames().size(), 1u);
  std::remove(path.c_str());
  EXPECT_EQ(errorOf([&] { saved().save("/nowhere/m.warp"); }),
            "saved module '/nowhere/m.warp' cannot be written: No such file or "
            "directory");
}

TEST_F(SavedModuleTest, FitsOnlyItsKernel) {
  SavedModule module = saved();
  Kernel same(Module::fromText(addText), "add");
  same.attach(module.kernels[0]);
  std::string changed = addText;
  changed.replace(changed.find("warp.add(%v"), 8, "warp.sub");
  Kernel other(Module::fromText(changed), "add");
  EXPECT_EQ(errorOf([&] { other.attach(module.kernels[0]); }),
            "kernel 'add' does not fit its saved code: its source has changed, "
            "compile the module again");
  KernelOptions options;
  options.debug = true;
  Kernel debug(Module::fromText(addText), "add", options);
  EXPECT_EQ(errorOf([&] { debug.attach(module.kernels[0]); }),
            "kernel 'add' does not fit its saved code: that was compiled in "
            "release mode, compile the module again");
}

TEST_F(SavedModuleTest, NeedsItsProcessor) {
  SavedModule module = saved();
  checkProcessor(module.kernels[0]);
  module.kernels[0].processor = "future +sse2,+brainwaves,-avx,+rdseed";
  EXPECT_EQ(errorOf([&] { checkProcessor(module.kernels[0]); }),
            "kernel 'add' was compiled for 'future', this processor lacks "
            "'brainwaves'");
}

TEST_F(SavedModuleTest, HasPtxForGpusThatAreNotThere) {
  KernelOptions options;
  options.maxThreads = 128;
  options.minBlocks = 3;
  SavedModule module = saved(80, options);
  const SavedKernel &kernel = module.kernels[0];
  EXPECT_EQ(kernel.target, "sm_80");
  // Large launches, small ones, negative integers, everything else.
  ASSERT_EQ(kernel.variants.size(), 4u);
  EXPECT_TRUE(kernel.variants[0].large);
  EXPECT_TRUE(kernel.variants[3].flat);
  for (const SavedVariant &variant : kernel.variants) {
    std::string ptx(variant.code.binary.begin(), variant.code.binary.end());
    EXPECT_NE(ptx.find(".target sm_80"), std::string::npos);
    EXPECT_NE(ptx.find(".maxntid 128"), std::string::npos);
    EXPECT_NE(ptx.find(".minnctapersm 3"), std::string::npos);
    EXPECT_EQ(variant.blockDim, 128);
  }
}

// The driver of the CUDA tests; see cuda-runtime-test.cpp.
TEST_F(SavedModuleTest, LaunchesPtxOnADevice) {
  void *library = dlopen(std::getenv("WARP_CUDA_DRIVER"), RTLD_NOW);
  auto *lastLaunch = library ? reinterpret_cast<const char *(*)()>(
                                   dlsym(library, "fakeCudaLastLaunch"))
                             : nullptr;
  if (!lastLaunch)
    GTEST_SKIP() << "needs the fake driver";
  SavedModule module = saved(70);
  auto kernel = module.kernel("add");
  Array<float> x(0, {5000}), y(0, {5000});
  launch(*kernel, 0, {5000}, x, y, 0, 1.0f);
  EXPECT_STREQ(lastLaunch(), "(40, 1, 1) x (128, 1, 1)");
  std::string problem = errorOf([&] {
    LaunchDim dim;
    dim.extent[0] = 10;
    std::vector<uint64_t> block(kernel->parameterSize() / 8);
    kernel->launch(0, dim, block.data(), nullptr, 64);
  });
  EXPECT_NE(problem.find("1 dimension, blocks of 64), there is: (sm_70, 1 "
                         "dimension, blocks of 256)"),
            std::string::npos)
      << problem;
}

TEST_F(SavedModuleTest, PropertiesComeFromTheDriver) {
  void *library = dlopen(std::getenv("WARP_CUDA_DRIVER"), RTLD_NOW);
  if (!library || !dlsym(library, "fakeCudaLastLaunch"))
    GTEST_SKIP() << "needs the fake driver";
  KernelOptions options;
  options.maxThreads = 512;
  Kernel kernel(Module::fromText(addText), "add", options);
  CudaProperties found = kernel.cudaProperties(0, 128);
  EXPECT_EQ(found.registers, 40);
  EXPECT_EQ(found.localMemory, 16);
  EXPECT_EQ(found.sharedMemory, 1024);
  EXPECT_EQ(found.blocksPerMultiprocessor, 8);
  // The code is that of launches, made before or now.
  EXPECT_EQ(kernel.suggestedBlock(0), std::make_pair(128, 264));
  Kernel other(Module::fromText(addText), "add", options);
  EXPECT_EQ(other.suggestedBlock(0), std::make_pair(256, 264));
  EXPECT_EQ(errorOf([&] { kernel.load(0, 513); }),
            "launch('add'): expects 1 to 512 threads per block, but got '513'");
  KernelOptions huge;
  huge.blockDim = 5000;
  Kernel impossible(Module::fromText(addText), "add", huge);
  EXPECT_EQ(errorOf([&] { impossible.load(0); }),
            "launch('add'): expects 1 to 1024 threads per block, but got "
            "'5000'");
}
