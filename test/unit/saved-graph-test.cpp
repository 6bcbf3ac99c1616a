//===- saved-graph-test.cpp - Graphs in files, without Python -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The CUDA part runs against the fake driver, or on a GPU with
// WARP_CUDA_DRIVER=libcuda.so.1, as in graph-test.cpp.
//
//===----------------------------------------------------------------------===//

#include "Graphs/GraphFile.h"
#include "Runtime/Support.h"
#include "warp/Array.h"
#include "warp/HashGrid.h"
#include "warp/Mesh.h"
#include "warp/Runtime.h"
#include "warp/SavedGraph.h"
#include "warp/SavedModule.h"
#include "warp/Sequences.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <gtest/gtest.h>
#include <random>
#include <vector>

using namespace warp;

static const int chooseDriver = setenv("WARP_CUDA_DRIVER", WARP_FAKE_CUDA, 0);

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

using Floats = std::vector<float>;

/// out[i] = ids[i], and the id that is an argument behind them.
static const char *const idsText = R"(
module @ids {
  func.func @ids(%ids: !warp.array<1 x ui64>, %out: !warp.array<1 x ui64>,
                 %id: ui64, %number: ui64)
      attributes {warp.arg_names = ["ids", "out", "id", "number"],
                  warp.kernel} {
    %zero = warp.constant 0 : si32
    %one = warp.constant 1 : si32
    %first = warp.load %ids[%zero] : !warp.array<1 x ui64>, si32 -> ui64
    warp.store %first, %out[%zero] : ui64, !warp.array<1 x ui64>, si32
    warp.store %id, %out[%one] : ui64, !warp.array<1 x ui64>, si32
    %two = warp.constant 2 : si32
    warp.store %number, %out[%two] : ui64, !warp.array<1 x ui64>, si32
    %mesh = warp.constant 3 : si32
    %a = warp.library_call "warp_slot"(%first, %mesh) : (ui64, si32) -> ui64
    %b = warp.library_call "warp_slot"(%id, %one) : (ui64, si32) -> ui64
    return
  }
})";

namespace {

/// A tetrahedron.
struct Solid {
  Floats points = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::vector<int32_t> faces = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};

  MeshArrays arrays() {
    MeshArrays arrays;
    arrays.points = rows(points.data(), 4, 12);
    arrays.indices = rows(faces.data(), 12, 4);
    return arrays;
  }
  static ArrayDescriptor rows(void *data, int32_t count, int32_t size) {
    ArrayDescriptor array;
    array.data = data;
    array.ndim = 1;
    array.shape[0] = count;
    array.strides[0] = size;
    return array;
  }
};

class SavedGraphs : public testing::Test {
protected:
  void SetUp() override { KernelCache::get().setEnabled(false); }

  template <typename Fn> std::string errorOf(Fn &&fn) {
    try {
      fn();
    } catch (const Error &error) {
      return error.message;
    }
    return "no error";
  }

  /// y = x + 2, then x = y reversed by pairs, three times.
  GraphFiles example() {
    Kernel add(Module::fromText(addText), "add");
    Floats x = {1, 2, 3, 4}, y(4);
    std::vector<int> left = {3};
    auto capture = Capture::begin(cpuDevice, nullptr, CaptureMode::ThreadLocal,
                                  false, true);
    auto loop = capture->addCondition(left.data(), false);
    capture->beginBody(loop, true);
    launch(add, cpuDevice, {4}, view(x.data(), {4}), view(y.data(), {4}), 2.0f);
    auto to = view(x.data() + 3, {2, 2}, {-2, -1}).descriptor;
    auto from = view(y.data(), {2, 2}).descriptor;
    copyArray({&to, cpuDevice}, {&from, cpuDevice}, 4);
    scanNumbers(cpuDevice, NumberType::Int32, 1, {left.data(), 4},
                {left.data(), 4}, 1, false);
    capture->updateCondition(loop, left.data(), false);
    capture->endBody();
    auto graph = capture->end();
    return graphFiles(*graph, {{"x", x.data(), 16}, {"y", y.data(), 16}});
  }

  /// Refits a mesh, builds a grid and writes their ids, of which one comes from
  /// an array. All of it is gone afterwards.
  GraphFiles geometryExample() {
    Kernel kernel(Module::fromText(idsText), "ids");
    Solid solid;
    Mesh mesh(solid.arrays(), cpuDevice);
    HashGrid grid({2, 3, 4});
    std::vector<uint64_t> ids = {mesh.id()}, out(3);
    number = grid.id();
    auto capture = Capture::begin(cpuDevice, nullptr, CaptureMode::ThreadLocal,
                                  false, true);
    mesh.refit(solid.arrays());
    grid.build(solid.arrays().points, 4, 0.5);
    launch(kernel, cpuDevice, {1}, view(ids.data(), {1}), view(out.data(), {3}),
           grid.id(), number);
    return graphFiles(*capture->end(), {{"out", out.data(), 24},
                                        {"points", solid.points.data(), 48}});
  }
  int mutate(const GraphFiles &files, int turns);

  /// An argument of the geometry's graph that has the value of an id.
  uint64_t number = 0;
};

} // namespace

TEST_F(SavedGraphs, ReplayWithoutTheKernels) {
  auto graph = LoadedGraph::fromFiles(example(), cpuDevice, "here");
  EXPECT_EQ(graph->names(), (std::vector<std::string>{"x", "y"}));
  EXPECT_EQ(graph->bytes("x"), 16u);
  graph->launch();
  Floats x(4), y(4);
  graph->get("x", x.data(), 16);
  graph->get("y", y.data(), 16);
  // The scan makes the condition zero at the first turn.
  EXPECT_EQ(y, (Floats{3, 4, 5, 6}));
  EXPECT_EQ(x, (Floats{6, 5, 4, 3}));
  Floats other = {10, 20, 30, 40};
  graph->set("x", other.data(), 16);
  graph->launch();
  graph->get("y", y.data(), 16);
  // The loop's condition is memory of the graph, and zero by now.
  EXPECT_EQ(y, (Floats{3, 4, 5, 6}));
  EXPECT_TRUE(graph->has("y"));
  EXPECT_FALSE(graph->has("z"));
  EXPECT_EQ(errorOf([&] { graph->get("z", x.data(), 16); }),
            "the graph has no array 'z', it has: 'x', 'y'");
  EXPECT_EQ(errorOf([&] { graph->set("x", x.data(), 8); }),
            "the graph's array 'x' has 16 bytes, but got 8");
}

TEST_F(SavedGraphs, FilesReplaceEachOther) {
  namespace fs = std::filesystem;
  fs::path folder = fs::temp_directory_path() / "warp-saved-graph-test";
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::string path = (folder / "step.wrp").string();
  Kernel add(Module::fromText(addText), "add");
  Floats x = {1, 2}, y(2);
  for (float s : {1.0f, 5.0f}) {
    auto capture = Capture::begin(cpuDevice, nullptr, CaptureMode::ThreadLocal,
                                  false, true);
    launch(add, cpuDevice, {2}, view(x.data(), {2}), view(y.data(), {2}), s);
    saveGraph(*capture->end(), path, {{"y", y.data(), 8}});
    auto graph = LoadedGraph::load(path, cpuDevice);
    graph->launch();
    Floats result(2);
    graph->get("y", result.data(), 8);
    EXPECT_EQ(result, (Floats{1 + s, 2 + s}));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder / "step_modules"),
                          fs::directory_iterator()),
            1);
  auto capture = Capture::begin(cpuDevice);
  EXPECT_EQ(errorOf([&] { LoadedGraph::load(path, cpuDevice); }),
            "saved graph '" + path +
                "' cannot be loaded while this thread captures a graph");
  auto plain = capture->end();
  EXPECT_EQ(errorOf([&] { saveGraph(*plain, path, {}); }),
            "cannot save the graph: it was not captured with apic=True");
  fs::remove_all(folder);
}

TEST_F(SavedGraphs, RejectDamagedFiles) {
  GraphFiles files = example();
  auto load = [&](const std::string &bytes) {
    return errorOf([&] {
      LoadedGraph::fromFiles({bytes, files.modules}, cpuDevice, "g");
    });
  };
  EXPECT_EQ(load(files.graph), "no error");
  EXPECT_EQ(load(""), "saved graph 'g' is not a saved graph");
  std::string other = files.graph;
  other[8] = 99;
  EXPECT_EQ(load(other), "saved graph 'g' has format 99, but this release "
                         "reads format 4, save it again");
  for (size_t at = 12; at < files.graph.size(); at += 3) {
    std::string broken = files.graph;
    broken[at] ^= 1;
    EXPECT_EQ(load(broken),
              "saved graph 'g' is damaged, its checksum does not fit");
    std::string shorter = files.graph.substr(0, at);
    EXPECT_NE(load(shorter), "no error");
  }
  GraphFiles alone{files.graph, {}};
  EXPECT_NE(errorOf([&] {
              LoadedGraph::fromFiles(alone, cpuDevice, "g");
            }).find("which was not provided"),
            std::string::npos);
}

/// Files whose checksum fits, but not what is in them: an error or a graph,
/// never a crash. Nothing is launched, since extents may be any.
int SavedGraphs::mutate(const GraphFiles &files, int turns) {
  constexpr size_t header = 28;
  std::mt19937 random(7);
  auto below = [&](size_t end) { return random() % end; };
  int refused = 0;
  for (int turn = 0; turn < turns; ++turn) {
    std::string bytes = files.graph;
    for (size_t i = 0, count = 1 + below(3); i < count; ++i) {
      size_t at = header + below(bytes.size() - header);
      if (below(8) == 0)
        bytes.erase(at, 1 + below(9));
      else if (below(4) == 0)
        bytes[at] = char(below(2) ? 0xff : 0);
      else
        bytes[at] ^= char(1 << below(8));
      if (bytes.size() <= header)
        break;
    }
    uint64_t size = bytes.size() - header;
    uint64_t hash = hashBytes(bytes.data() + header, size);
    std::memcpy(bytes.data() + 12, &size, 8);
    std::memcpy(bytes.data() + 20, &hash, 8);
    std::string error = errorOf([&] {
      uint64_t total = 0;
      for (auto &block : graphs::GraphFile::fromBytes(bytes, "g").blocks)
        total += block.bytes;
      if (total < (1 << 20))
        LoadedGraph::fromFiles({bytes, files.modules}, cpuDevice, "g");
    });
    refused += error != "no error";
    EXPECT_FALSE(isCapturing(cpuDevice)) << error;
  }
  return refused;
}

TEST_F(SavedGraphs, SurviveMutations) {
  EXPECT_GT(mutate(example(), 4000), 1000);
  EXPECT_GT(mutate(geometryExample(), 4000), 1000);
}

//===----------------------------------------------------------------------===//
// Geometry
//===----------------------------------------------------------------------===//

TEST_F(SavedGraphs, HaveTheirOwnGeometry) {
  auto graph = LoadedGraph::fromFiles(geometryExample(), cpuDevice, "here");
  graph->launch();
  uint64_t ids[3];
  graph->get("out", ids, sizeof ids);
  ASSERT_EQ(findHandle(ids[0], cpuDevice), GeometryKind::Mesh);
  ASSERT_EQ(findHandle(ids[1], cpuDevice), GeometryKind::HashGrid);
  // That no kernel takes for an id.
  EXPECT_EQ(ids[2], number);
  EXPECT_NE(ids[1], number);
  // The mesh reads points that the graph has under a name.
  HandleContents mesh = readHandle(ids[0]);
  auto points = reinterpret_cast<uint64_t>(graph->data("points"));
  EXPECT_TRUE(std::any_of(
      mesh.pointers.begin(), mesh.pointers.end(), [&](const auto &pointer) {
        return pointer.begin == points && pointer.end == points + 48;
      }));
  // Cells, and how many points were put into them.
  int32_t counts[4];
  std::memcpy(counts, readHandle(ids[1]).words.data() + 1, sizeof counts);
  EXPECT_EQ(std::vector<int32_t>(counts, counts + 4),
            (std::vector<int32_t>{2, 3, 4, 4}));
  graph.reset();
  EXPECT_FALSE(findHandle(ids[0], cpuDevice));
  EXPECT_FALSE(findHandle(ids[1], cpuDevice));
}

TEST_F(SavedGraphs, RefuseGeometryThatIsGone) {
  Kernel kernel(Module::fromText(idsText), "ids");
  std::vector<uint64_t> ids(1), out(3);
  auto capture =
      Capture::begin(cpuDevice, nullptr, CaptureMode::ThreadLocal, false, true);
  launch(kernel, cpuDevice, {1}, view(ids.data(), {1}), view(out.data(), {3}),
         HashGrid({2, 2, 2}).id(), uint64_t(0));
  auto graph = capture->end();
  EXPECT_EQ(errorOf([&] { graphFiles(*graph, {}); }),
            "cannot save the graph: the launch of 'ids' has the id of a freed "
            "HashGrid");
}

//===----------------------------------------------------------------------===//
// CUDA
//===----------------------------------------------------------------------===//

TEST_F(SavedGraphs, OnCuda) {
  ASSERT_EQ(chooseDriver, 0);
  if (cudaDeviceCount() == 0)
    GTEST_SKIP() << cudaUnavailableReason();
  Array<int> x(0, {4}), y(0, {4}), flag(0, {1});
  std::vector<int> numbers = {1, 2, 3, 4};
  int zero = 0;
  x.copyFrom(numbers.data());
  y.copyFrom(numbers.data());
  flag.copyFrom(&zero);
  synchronizeDevice(0);
  auto capture =
      Capture::begin(0, nullptr, CaptureMode::ThreadLocal, false, true);
  copyMemory(y.data(), 0, x.data(), 0, 16);
  int value = 9;
  fillMemory(x.data() + 1, 0, &value, 4, 2);
  copyMemory(x.data(), 0, numbers.data() + 3, cpuDevice, 4);
  if (supportsConditionalGraphs()) {
    auto branch = capture->addCondition(flag.data(), true);
    capture->beginBody(branch, false);
    setMemory(y.data() + 3, 0, 0, 4);
    capture->endBody();
  }
  auto captured = capture->end();
  GraphFiles files = graphFiles(
      *captured,
      {{"x", x.data(), 16}, {"y", y.data(), 16}, {"flag", flag.data(), 4}});
  EXPECT_TRUE(files.modules.empty());
  auto graph = LoadedGraph::fromFiles(files, 0, "g");
  EXPECT_EQ(graph->device(), 0);
  auto get = [&](const char *name) {
    std::vector<int> result(4);
    graph->get(name, result.data(), 16);
    synchronizeDevice(0);
    return result;
  };
  EXPECT_EQ(get("x"), numbers);
  graph->launch();
  EXPECT_EQ(get("x"), (std::vector<int>{4, 9, 9, 4}));
  int last = supportsConditionalGraphs() ? 0 : 4;
  EXPECT_EQ(get("y"), (std::vector<int>{1, 2, 3, last}));
  Array<int> other(0, {4});
  other.copyFrom(numbers.data());
  graph->set("x", other.data(), 16, 0);
  int one = 1;
  graph->set("flag", &one, 4);
  graph->launch();
  EXPECT_EQ(get("y"), numbers);
  EXPECT_EQ(errorOf([&] {
              LoadedGraph::fromFiles(files, cpuDevice, "g");
            }).find("saved graph 'g' was made for 'sm_"),
            0u);
}

TEST_F(SavedGraphs, LaunchesOnCuda) {
  if (cudaDeviceCount() == 0)
    GTEST_SKIP() << cudaUnavailableReason();
  Kernel add(Module::fromText(addText), "add");
  Array<float> x(0, {4}), y(0, {4});
  auto capture =
      Capture::begin(0, nullptr, CaptureMode::ThreadLocal, false, true);
  launch(add, 0, {4}, x, y, 1.5f);
  launch(add, 0, {2}, y, x, 1.5f);
  auto captured = capture->end();
  GraphFiles files = graphFiles(*captured, {{"y", y.data(), 16}});
  ASSERT_EQ(files.modules.size(), 1u);
  const std::string &name = files.modules.begin()->first;
  EXPECT_NE(name.find(".sm_"), std::string::npos);
  SavedModule module =
      SavedModule::fromBytes(files.modules.begin()->second, name);
  ASSERT_EQ(module.kernels.size(), 1u);
  // PTX, which later devices run, too.
  const std::vector<char> &code = module.kernels[0].variants[0].code.binary;
  EXPECT_NE(std::string(code.begin(), code.end()).find(".version"),
            std::string::npos);
  auto graph = LoadedGraph::fromFiles(files, 0, "g");
  EXPECT_EQ(graph->graph().size(), captured->size());
  graph->launch();
  synchronizeDevice(0);
}

TEST_F(SavedGraphs, RefuseCopiesToTheHost) {
  if (cudaDeviceCount() == 0)
    GTEST_SKIP() << cudaUnavailableReason();
  Array<int> x(0, {4});
  Buffer host(cpuDevice, 16, true);
  auto capture =
      Capture::begin(0, nullptr, CaptureMode::ThreadLocal, false, true);
  copyMemory(host.data(), cpuDevice, x.data(), 0, 16);
  auto captured = capture->end();
  EXPECT_EQ(errorOf([&] { graphFiles(*captured, {}); }),
            "cannot save the graph: it has a copy to the host, which no file "
            "holds");
}
