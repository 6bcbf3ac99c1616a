//===- jit-test.cpp - Compiled code in the process ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Compiler/Abandon.h"
#include "warp/Compile.h"
#include "warp/Error.h"
#include "warp/Launch.h"

#include <cmath>
#include <cstring>
#include <gtest/gtest.h>
#include <thread>
#include <vector>

using namespace warp;

namespace {

/// y[i] = f(x[i]) in the dialect's text.
std::string unaryKernel(const std::string &builtin) {
  return R"(
func.func @k(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel} {
  %i = warp.tid : si32
  %0 = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %1 = warp.)" + builtin + R"((%0) : (f32) -> f32
  warp.store %1, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
})";
}

struct Block {
  LaunchHeader header;
  ArrayDescriptor x, y;
};

ArrayDescriptor describe(std::vector<float> &data) {
  ArrayDescriptor array;
  array.data = data.data();
  array.shape[0] = static_cast<int32_t>(data.size());
  array.strides[0] = sizeof(float);
  array.ndim = 1;
  return array;
}

std::vector<float> run(void *entry, std::vector<float> x, int64_t begin,
                       int64_t end) {
  std::vector<float> y(x.size(), -1.0f);
  Block block{{}, describe(x), describe(y)};
  block.header.dim[0] = static_cast<int32_t>(x.size());
  reinterpret_cast<CpuEntry>(entry)(&block, begin, end);
  return y;
}

Code compileUnary(const std::string &builtin, uint64_t packed) {
  CompileOptions options;
  options.packed = packed;
  return compile(Module::fromText(unaryKernel(builtin)), options);
}

} // namespace

// An entry runs its range and nothing else, whatever the range's length is
// relative to the vectors'.
TEST(Jit, RunsTheRange) {
  Code code = compileUnary("neg", 3);
  void *entry = Jit::get().load(code);
  std::vector<float> x(100);
  for (size_t i = 0; i < x.size(); ++i)
    x[i] = static_cast<float>(i);
  for (int64_t begin : {0, 1, 7, 33})
    for (int64_t end : {0, 1, 34, 64, 99, 100}) {
      std::vector<float> y = run(entry, x, begin, end);
      for (int64_t i = 0; i < 100; ++i)
        EXPECT_EQ(y[i], i >= begin && i < end ? -x[i] : -1.0f)
            << i << " of [" << begin << ", " << end << ")";
    }
  Jit::get().unload(entry);
}

// Two objects with the same names live side by side.
TEST(Jit, KeepsNamesApart) {
  void *sine = Jit::get().load(compileUnary("sin", 0));
  void *root = Jit::get().load(compileUnary("sqrt", 3));
  std::vector<float> x{0.0f, 0.25f, 4.0f};
  EXPECT_NE(sine, root);
  EXPECT_FLOAT_EQ(run(sine, x, 0, 3)[2], std::sin(4.0f));
  EXPECT_FLOAT_EQ(run(root, x, 0, 3)[2], 2.0f);
  Jit::get().unload(sine);
  EXPECT_FLOAT_EQ(run(root, x, 0, 3)[1], 0.5f);
  Jit::get().unload(root);
}

// Functions outside the device library come from the C library.
TEST(Jit, CallsTheCLibrary) {
  void *entry = Jit::get().load(compileUnary("erf", 3));
  EXPECT_FLOAT_EQ(run(entry, {0.5f}, 0, 1)[0], std::erf(0.5f));
  Jit::get().unload(entry);
}

TEST(Jit, RefusesWhatIsNoObject) {
  Code code;
  code.entry = "k";
  code.binary = {'n', 'o', 'n', 'e'};
  EXPECT_THROW(Jit::get().load(code), Error);
}

TEST(Jit, RefusesAnObjectWithoutTheEntry) {
  Code code = compileUnary("neg", 3);
  code.entry = "other";
  EXPECT_THROW(Jit::get().load(code), Error);
}

// Threads compile at the same time.
TEST(Compile, Concurrently) {
  std::vector<std::thread> threads;
  std::vector<float> results(4);
  const char *builtins[] = {"sin", "cos", "exp", "sqrt"};
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      void *entry = Jit::get().load(compileUnary(builtins[t], 3));
      results[t] = run(entry, {0.5f}, 0, 1)[0];
      Jit::get().unload(entry);
    });
  for (std::thread &thread : threads)
    thread.join();
  EXPECT_FLOAT_EQ(results[0], std::sin(0.5f));
  EXPECT_FLOAT_EQ(results[1], std::cos(0.5f));
  EXPECT_FLOAT_EQ(results[2], std::exp(0.5f));
  EXPECT_FLOAT_EQ(results[3], std::sqrt(0.5f));
}

// A text that is no kernel is an error with a place, never a crash.
TEST(Compile, NamesThePass) {
  try {
    compile(Module::fromText("func.func @f() { return }"), {});
    FAIL();
  } catch (const Error &error) {
    EXPECT_NE(std::string(error.what()).find("'warp.kernel'"),
              std::string::npos);
    EXPECT_NE(std::string(error.what()).find("in pass 'warp-verify-warp'"),
              std::string::npos);
  }
}

// A thread gives up what it compiles once nobody wants it, and only then.
TEST(Jit, CompilationsAreGivenUp) {
  std::atomic<bool> isUnwanted{false};
  {
    Abandonable scope(isUnwanted);
    EXPECT_FALSE(compileUnary("sin", 3).binary.empty());
    isUnwanted = true;
    EXPECT_THROW(compileUnary("sin", 3), Error);
    std::thread other(
        [] { EXPECT_FALSE(compileUnary("sin", 3).binary.empty()); });
    other.join();
  }
  EXPECT_FALSE(compileUnary("sin", 3).binary.empty());
}
