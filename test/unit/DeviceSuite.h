//===- DeviceSuite.h - Conformance tests of devices -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Every method of lib/Runtime/Device.h has tests that run once per kind of
// device: on the CPU, and on CUDA device 0 of the driver that WARP_CUDA_DRIVER
// names, by default a fake one made of host memory. The fake does all but run
// kernels; it records their launches instead.
//
//   warp-unit-tests --gtest_filter='Devices/*'
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TEST_UNIT_DEVICESUITE_H
#define WARP_TEST_UNIT_DEVICESUITE_H

#include "Runtime/Device.h"
#include "warp/LaunchQueue.h"

#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <numeric>
#include <string>
#include <vector>

namespace warp::test {

/// Before any test makes the runtime look for a driver.
inline const int chooseDriver = setenv("WARP_CUDA_DRIVER", WARP_FAKE_CUDA, 0);
/// Machine code of a real one is nothing for the fake driver.
inline const bool hasNoAssembler = (setAssembler(""), true);

template <typename Fn> Fn *fakeSymbol(const char *name) {
  void *library = dlopen(std::getenv("WARP_CUDA_DRIVER"), RTLD_NOW);
  return library ? reinterpret_cast<Fn *>(dlsym(library, name)) : nullptr;
}

class DeviceSuite : public testing::TestWithParam<int> {
protected:
  void SetUp() override {
    ASSERT_EQ(chooseDriver, 0);
    if (number >= cudaDeviceCount())
      GTEST_SKIP() << cudaUnavailableReason();
  }

  const int number = GetParam();
  Device &device() const { return deviceAt(number); }
  bool isHost() const { return warp::isHost(number); }
  /// False for the fake driver.
  bool runsKernels() const {
    return isHost() || !fakeSymbol<const char *()>("fakeCudaLastLaunch");
  }
  /// "(grid) x (block)" of the launch that the fake driver recorded last.
  static std::string lastLaunch() {
    return fakeSymbol<const char *()>("fakeCudaLastLaunch")();
  }
};

/// Numbers in the memory of a device.
template <typename T> class Numbers {
public:
  Numbers(int device, const std::vector<T> &values)
      : buffer(device, values.size() * sizeof(T)), count(values.size()) {
    upload(buffer.data(), device, values.data(), buffer.size());
  }
  Numbers(int device, size_t count, T value = {})
      : Numbers(device, std::vector<T>(count, value)) {}

  T *data() const { return static_cast<T *>(buffer.data()); }
  size_t size() const { return count; }
  std::vector<T> get() const {
    std::vector<T> values(count);
    download(values.data(), buffer.data(), buffer.device(), buffer.size());
    synchronizeDevice(buffer.device());
    return values;
  }

private:
  Buffer buffer;
  size_t count;
};

inline std::vector<int> iota(size_t count) {
  std::vector<int> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0);
  return numbers;
}

inline ArrayDescriptor view(void *data, const std::vector<int> &shape,
                            const std::vector<int> &strides) {
  ArrayDescriptor array;
  array.data = data;
  array.ndim = static_cast<int>(shape.size());
  std::copy(shape.begin(), shape.end(), array.shape);
  std::copy(strides.begin(), strides.end(), array.strides);
  return array;
}

inline ArrayDescriptor packed(void *data, const std::vector<int> &shape,
                              int size) {
  std::vector<int> strides(shape.size());
  for (size_t i = shape.size(); i-- > 0; size *= shape[i])
    strides[i] = size;
  return view(data, shape, strides);
}

#define WARP_TEST_DEVICES(Suite)                                               \
  INSTANTIATE_TEST_SUITE_P(                                                    \
      Devices, Suite, testing::Values(warp::cpuDevice, 0),                     \
      [](const auto &info) { return info.param == 0 ? "Cuda" : "Cpu"; })

} // namespace warp::test

#endif // WARP_TEST_UNIT_DEVICESUITE_H
