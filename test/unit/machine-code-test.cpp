//===- machine-code-test.cpp - Machine code of GPU kernels on disk --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Each kernel object stands for a process: it has nothing but the disk cache.
//
//===----------------------------------------------------------------------===//

#include "DeviceSuite.h"
#include "Runtime/KernelClaim.h"
#include "Runtime/MachineCode.h"
#include "warp/Background.h"
#include "warp/KernelCache.h"
#include "warp/LaunchQueue.h"
#include "warp/Runtime.h"

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <string>
#include <thread>
#include <unistd.h>

using namespace warp;
using namespace warp::test;
namespace fs = std::filesystem;

namespace {

const char *const scaleText = R"(
func.func @scale(%x: !warp.array<1 x f32>) attributes {warp.kernel} {
  %i = warp.tid : si32
  %v = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %w = warp.add(%v, %v) : (f32, f32) -> f32
  warp.store %w, %x[%i] : f32, !warp.array<1 x f32>, si32
  return
})";

/// The same with more operations, whose PTX is long.
std::string longText() {
  std::string text = scaleText, step;
  for (int i = 0; i < 2600; ++i) {
    std::string now = i ? "%s" + std::to_string(i - 1) : "%w";
    std::string next = std::to_string(i);
    step += "  %p" + next + " = warp.mul(" + now + ", " + now +
            ") : (f32, f32) -> f32\n  %s" + next + " = warp.add(%p" + next +
            ", %v) : (f32, f32) -> f32\n";
  }
  size_t store = text.find("  warp.store %w");
  text.replace(text.find("%w", store), 2, "%s2599");
  return text.insert(store, step);
}

class MachineCodeTest : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    assemblies = fakeSymbol<int()>("fakeCudaAssemblies");
    setLinkedStack = fakeSymbol<void(int)>("fakeCudaSetLinkedStack");
    if (!assemblies)
      GTEST_SKIP() << "needs the fake driver";
    char name[] = "/tmp/warp-machine-code-XXXXXX";
    folder = mkdtemp(name);
    before = KernelCache::get().directory();
    KernelCache::get().setDirectory(folder);
    KernelCache::get().setEnabled(true);
    setAssembler("");
  }
  void TearDown() override {
    if (!assemblies)
      return;
    waitForBackground();
    setLinkedStack(16);
    setAssembler("");
    KernelCache::get().setDirectory(before);
    KernelCache::get().setEnabled(false);
    fs::remove_all(folder);
  }

  /// Arguments of a launch over 100 elements, of an array without memory.
  static std::vector<char> paramsOf(const Kernel &kernel) {
    std::vector<char> params(kernel.parameterSize());
    ArrayDescriptor x = packed(nullptr, {100}, sizeof(float));
    std::memcpy(params.data() + kernel.parameters()[0].offset, &x, sizeof x);
    return params;
  }

  /// Assemblies of a process that launches so many times.
  int run(int launches = 1, bool quickFirst = true) {
    KernelOptions options;
    options.quickFirst = quickFirst;
    Kernel kernel(Module::fromText(scaleText), "scale", options);
    int first = assemblies();
    LaunchDim dim;
    dim.extent[0] = 100;
    for (int i = 0; i < launches; ++i)
      kernel.launch(0, dim, paramsOf(kernel).data());
    waitForBackground();
    return assemblies() - first;
  }

  /// The same with launches that wait for their code.
  int runQueued(int launches, const std::string &text) {
    setLazyCompile(true);
    KernelOptions options;
    options.quickFirst = true;
    Kernel kernel(Module::fromText(text), "scale", options);
    int first = assemblies();
    LaunchDim dim;
    dim.extent[0] = 100;
    for (int i = 0; i < launches; ++i) {
      std::vector<char> params = paramsOf(kernel);
      Kernel::Plan plan = kernel.tryPrepare(0, dim, params.data(), 0);
      if (plan.variant && !Kernel::mustQueue(0))
        kernel.launch(0, dim, params.data());
      else
        EXPECT_TRUE(kernel.queue(plan, 0, dim, params.data(), nullptr, 0));
      synchronizeDevice(0);
    }
    waitForBackground();
    return assemblies() - first;
  }

  std::string machineFile() {
    for (const auto &entry : fs::directory_iterator(folder))
      if (entry.path().extension() == ".machine")
        return entry.path();
    return "";
  }

  /// Programs in the place of `ptxas` that say that they are of a release, and
  /// then do something. The fake driver is of 12.8.
  void useAssembler(const std::string &release, const std::string &work) {
    std::string file = folder + "/ptxas-" + std::to_string(++programs);
    std::ofstream(file) << "#!/bin/sh\n"
                        << "if [ \"$1\" = --version ]; then\n"
                        << "  echo 'Cuda compilation tools, release " << release
                        << ", V1'; exit 0\nfi\n"
                        << "echo $1 $5 >> " << folder << "/asked\n"
                        << work << "\n";
    fs::permissions(file, fs::perms::owner_all);
    setAssembler(file);
  }
  /// As the fake driver's linker does.
  static constexpr const char *assembles =
      "{ printf '\\177ELF'; cat \"$2\"; } > \"$4\"";
  /// Arguments of each time that one was asked, in lines.
  std::string asked() {
    std::ifstream file(folder + "/asked");
    std::string text{std::istreambuf_iterator<char>(file), {}};
    fs::remove(folder + "/asked");
    return text;
  }

  int programs = 0;
  std::string folder, before;
  int (*assemblies)() = nullptr;
  void (*setLinkedStack)(int) = nullptr;
};

} // namespace

// The first process has the program assembled for itself, and once more for
// those to come.
TEST_F(MachineCodeTest, ALaterProcessAssemblesNothing) {
  EXPECT_EQ(run(), 2);
  EXPECT_EQ(run(3), 0);
  EXPECT_EQ(run(3, /*quickFirst=*/false), 0);
}

// Launches that wait have long programs linked, beside each other. A kernel
// that is launched again is compared with the whole program, once.
TEST_F(MachineCodeTest, LaunchesThatWaitLinkLongProgramsFirst) {
  std::string text = longText();
  EXPECT_EQ(runQueued(1, text), 1);
  EXPECT_FALSE(findMachineCode(fs::path(machineFile()).stem())->isBest);
  EXPECT_EQ(runQueued(1, text), 0);
  EXPECT_EQ(runQueued(3, text), 1);
  EXPECT_TRUE(findMachineCode(fs::path(machineFile()).stem())->isBest);
  EXPECT_EQ(runQueued(3, text), 0);
}

// Others are what they were.
TEST_F(MachineCodeTest, LaunchesThatWaitHaveShortProgramsWhole) {
  EXPECT_EQ(runQueued(1, scaleText), 2);
  EXPECT_TRUE(findMachineCode(fs::path(machineFile()).stem())->isBest);
  EXPECT_EQ(runQueued(3, scaleText), 0);
}

// The toolkit's assembler makes whole programs, which are kept as they are.
TEST_F(MachineCodeTest, AProgramAssemblesBesideTheDriver) {
  useAssembler("12.8", assembles);
  std::string text = longText();
  EXPECT_EQ(runQueued(3, text), 0);
  EXPECT_EQ(asked(), "-arch=sm_90a\n");
  EXPECT_TRUE(findMachineCode(fs::path(machineFile()).stem())->isBest);
  EXPECT_EQ(runQueued(3, text), 0);
  EXPECT_EQ(asked(), "");
  // A launch that waits for nothing else has the driver do it, and keeps what
  // the program makes.
  EXPECT_EQ(run(), 1);
  EXPECT_EQ(asked(), "-arch=sm_90a\n");
  EXPECT_EQ(run(), 0);
}

// Ranks that start together need the same code: one has it assembled.
TEST_F(MachineCodeTest, ProcessesWaitForTheCodeOfOthers) {
  useAssembler("12.8", assembles);
  std::string text = longText();
  EXPECT_EQ(runQueued(1, text), 0);
  asked();
  std::string file = machineFile(), key = fs::path(file).stem();
  std::string claim = folder + "/" + key + claimSuffix;
  char host[256] = {};
  gethostname(host, sizeof(host) - 1);
  std::ofstream(claim) << getpid() << " " << host << "\n";
  fs::rename(file, folder + "/other");
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    fs::rename(folder + "/other", file);
    fs::remove(claim);
  });
  EXPECT_EQ(runQueued(1, text), 0);
  other.join();
  EXPECT_EQ(asked(), "");
  // One that ends without code leaves it to the others.
  fs::remove(file);
  std::ofstream(claim) << "999999999 " << host << "\n";
  EXPECT_EQ(runQueued(1, text), 0);
  EXPECT_EQ(asked(), "-arch=sm_90a\n");
}

// Code of an earlier release runs until the driver's own is there.
TEST_F(MachineCodeTest, AnEarlierProgramMakesProvisionalCode) {
  useAssembler("12.4", assembles);
  std::string text = longText();
  EXPECT_EQ(runQueued(1, text), 0);
  EXPECT_FALSE(findMachineCode(fs::path(machineFile()).stem())->isBest);
  EXPECT_EQ(runQueued(3, text), 1);
  EXPECT_EQ(asked(), "-arch=sm_90a\n");
}

// The driver may not take the code of a later one.
TEST_F(MachineCodeTest, ALaterProgramIsNotAsked) {
  useAssembler("13.0", assembles);
  EXPECT_EQ(runQueued(3, longText()), 2);
  EXPECT_EQ(asked(), "");
}

// The driver does what a program cannot, which is asked three times.
TEST_F(MachineCodeTest, AProgramThatFailsIsReplaced) {
  for (const char *work : {"echo 'ptxas fatal' >&2; exit 1", "kill -9 $$",
                           "echo 'no machine code' > \"$4\"",
                           "printf '\\177ELF' > \"$4\"; exit 1"}) {
    useAssembler("12.8", work);
    for (int process = 0; process < 4; ++process) {
      EXPECT_EQ(runQueued(1, longText()), 1) << work;
      fs::remove(machineFile());
    }
    EXPECT_EQ(asked(), "-arch=sm_90a\n-arch=sm_90a\n-arch=sm_90a\n") << work;
  }
  setAssembler(folder + "/missing");
  EXPECT_EQ(runQueued(1, longText()), 1);
}

// As one for another card: the driver does not take it, and it is not kept.
TEST_F(MachineCodeTest, ForeignCodeOfAProgramIsReplaced) {
  useAssembler("12.8", "printf '\\177ELF of another card' > \"$4\"");
  EXPECT_EQ(runQueued(1, longText()), 1);
  EXPECT_EQ(asked(), "-arch=sm_90a\n");
  EXPECT_FALSE(findMachineCode(fs::path(machineFile()).stem())->isBest);
}

// Linked code that is worse runs until there is tier-1 code.
TEST_F(MachineCodeTest, WorseCodeIsReplaced) {
  setLinkedStack(32);
  EXPECT_EQ(run(), 2);
  EXPECT_EQ(run(1), 0);
  EXPECT_EQ(run(3), 1);
  // One that asks for the best code from the start has it.
  EXPECT_EQ(run(1, /*quickFirst=*/false), 1);
  setLinkedStack(16);
}

TEST_F(MachineCodeTest, ADamagedEntryCountsAsAbsent) {
  EXPECT_EQ(run(), 2);
  std::string file = machineFile();
  ASSERT_NE(file, "");
  auto size = fs::file_size(file);
  for (size_t at : {size_t(0), size_t(8), size_t(40), size / 2, size - 1}) {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekg(at);
    char byte = static_cast<char>(bytes.get() ^ 1);
    bytes.seekp(at);
    bytes.put(byte);
    bytes.close();
    EXPECT_EQ(run(), 2) << at;
    EXPECT_EQ(run(), 0) << at;
  }
  fs::resize_file(file, size / 3);
  EXPECT_EQ(run(), 2);
  fs::resize_file(file, 0);
  EXPECT_EQ(run(), 2);
  EXPECT_EQ(run(), 0);
}

// Machine code that the driver does not take, as of another card, goes.
TEST_F(MachineCodeTest, AForeignEntryCountsAsAbsent) {
  EXPECT_EQ(run(), 2);
  std::string key = fs::path(machineFile()).stem();
  std::optional<MachineCode> kept = findMachineCode(key);
  ASSERT_TRUE(kept);
  std::string other = "\177ELF of another card";
  storeMachineCode(key, {kept->entry, {other.begin(), other.end()}, true});
  EXPECT_EQ(run(), 2);
  // An entry of another kernel.
  storeMachineCode(key, {"other", kept->binary, true});
  EXPECT_EQ(run(), 2);
  EXPECT_EQ(run(), 0);
  // No machine code at all.
  storeMachineCode(key, {kept->entry, {'P', 'T', 'X'}, true});
  EXPECT_FALSE(findMachineCode(key));
}

TEST_F(MachineCodeTest, NothingIsKeptWithoutACache) {
  KernelCache::get().setEnabled(false);
  EXPECT_EQ(run(), 1);
  EXPECT_EQ(run(), 1);
  EXPECT_EQ(machineFile(), "");
}

// To ask for the size of blocks makes the code that the launch runs.
TEST_F(MachineCodeTest, BlockSizesAreThoseOfLaunchedCode) {
  KernelCache::get().setEnabled(false);
  Kernel kernel(Module::fromText(scaleText), "scale");
  int first = assemblies();
  EXPECT_EQ(kernel.suggestedBlock(0), std::make_pair(256, 264));
  EXPECT_EQ(assemblies() - first, 1);
  std::vector<char> params(kernel.parameterSize());
  ArrayDescriptor x = packed(nullptr, {100}, sizeof(float));
  std::memcpy(params.data() + kernel.parameters()[0].offset, &x, sizeof x);
  LaunchDim dim;
  dim.extent[0] = 100;
  kernel.launch(0, dim, params.data());
  EXPECT_EQ(kernel.suggestedBlock(0), std::make_pair(256, 264));
  EXPECT_EQ(assemblies() - first, 1);
}
