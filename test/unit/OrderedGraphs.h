//===- OrderedGraphs.h - Captures against the fake driver -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TEST_UNIT_ORDEREDGRAPHS_H
#define WARP_TEST_UNIT_ORDEREDGRAPHS_H

#include "warp/Fusion.h"
#include "warp/Graph.h"
#include "warp/Runtime.h"

#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <functional>
#include <gtest/gtest.h>
#include <random>

namespace warp {

using Random = std::minstd_rand;
inline int below(Random &random, int count) { return int(random() % count); }

inline const int chooseDriver = setenv("WARP_CUDA_DRIVER", WARP_FAKE_CUDA, 0);

class OrderedGraphs : public testing::Test {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    if (std::string(getenv("WARP_CUDA_DRIVER")) != WARP_FAKE_CUDA)
      GTEST_SKIP() << "not the fake driver";
    ASSERT_NE(cudaDeviceCount(), 0);
    void *library = dlopen(WARP_FAKE_CUDA, RTLD_NOW | RTLD_LOCAL);
    setOrder = reinterpret_cast<void (*)(unsigned)>(
        dlsym(library, "fakeCudaSetGraphOrder"));
    ASSERT_TRUE(setOrder);
    early = reinterpret_cast<int (*)()>(
        dlsym(library, "fakeCudaProgrammaticEdges"));
    ASSERT_TRUE(early);
  }
  void TearDown() override {
    if (setOrder)
      setOrder(0);
  }

  std::shared_ptr<Graph> record(const std::function<void(Capture &)> &fill,
                                NodeOrder order = NodeOrder::Dependencies) {
    auto capture = Capture::begin(0, nullptr, CaptureMode::ThreadLocal, false,
                                  false, order);
    fill(*capture);
    return capture->end();
  }

  void (*setOrder)(unsigned) = nullptr;
  /// Programmatic edges of the last graph.
  int (*early)() = nullptr;
};

inline const char *const addText = R"(
func.func @add(%x: !warp.array<1 x f32>, %y: !warp.array<1 x f32>)
    attributes {warp.kernel, warp.arg_names = ["x", "y"]} {
  %i = warp.tid : si32
  %a = warp.load %x[%i] : !warp.array<1 x f32>, si32 -> f32
  %b = warp.load %y[%i] : !warp.array<1 x f32>, si32 -> f32
  %c = warp.add(%a, %b) : (f32, f32) -> f32
  warp.store %c, %y[%i] : f32, !warp.array<1 x f32>, si32
  return
}
)";

/// Launches of a kernel that adds an array of 64 floats to another one.
class Additions {
public:
  Additions() : kernel(Module::fromText(addText), "add"), memory(0, 8 * 256) {}

  struct Block {
    LaunchHeader header;
    ArrayDescriptor x, y;
  };

  void launch(int from, int to, int threads, const Stream *stream = nullptr) {
    Block block;
    for (auto [array, place] : {std::pair(&block.x, from), {&block.y, to}}) {
      array->data = static_cast<char *>(memory.data()) + 256 * place;
      array->ndim = 1;
      array->shape[0] = 64;
      array->strides[0] = 4;
    }
    LaunchDim dim;
    dim.extent[0] = threads;
    kernel.launch(0, dim, &block, stream);
  }

  Kernel kernel;
  Buffer memory;
};

/// Launches of `Additions` add in graphs of the fake driver while it lives.
class RealAdditions : public Additions {
public:
  RealAdditions() {
    set(
        [](const void *bytes) {
          Block block;
          std::memcpy(&block, bytes, sizeof(block));
          for (int i = 0; i < block.header.dim[0]; ++i)
            static_cast<float *>(block.y.data)[i] +=
                static_cast<float *>(block.x.data)[i];
        },
        sizeof(Block));
  }
  ~RealAdditions() { set(nullptr, 0); }
  float &first(int place) {
    return static_cast<float *>(memory.data())[64 * place];
  }

private:
  static void set(void (*effect)(const void *), size_t bytes) {
    reinterpret_cast<void (*)(void (*)(const void *), size_t)>(dlsym(
        dlopen(WARP_FAKE_CUDA, RTLD_NOW), "fakeCudaSetEffect"))(effect, bytes);
  }
};

} // namespace warp

#endif // WARP_TEST_UNIT_ORDEREDGRAPHS_H
