// Loads the kernels that integrate_kernels.py saved and runs a few steps.
//
//   integrate MODULE.warp [DEVICE]
//
// DEVICE is -1, the CPU, or the number of a CUDA device.

#include "warp/Array.h"
#include "warp/SavedModule.h"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

namespace {
struct Vec3 {
  float x, y, z;
};
} // namespace

static int run(const char *path, int device) {
  constexpr int64_t count = 1000;
  constexpr int steps = 10;
  constexpr float dt = 0.01f;

  warp::SavedModule module = warp::SavedModule::load(path);
  auto integrate = module.kernel("integrate");

  std::vector<Vec3> start(count), end(count);
  for (int64_t i = 0; i < count; ++i)
    start[i] = {float(i), 0.0f, 0.0f};
  std::vector<Vec3> still(count, Vec3{0.0f, 1.0f, 0.0f});

  warp::Array<Vec3> x(device, {count}), v(device, {count});
  x.copyFrom(start.data());
  v.copyFrom(still.data());
  for (int step = 0; step < steps; ++step)
    warp::launch(*integrate, device, {count}, x, v, Vec3{0.0f, -9.81f, 0.0f},
                 dt);
  x.copyTo(end.data());

  // v grows by g dt before each of the steps.
  float height = 0, speed = 1;
  for (int step = 0; step < steps; ++step) {
    speed += -9.81f * dt;
    height += speed * dt;
  }
  for (int64_t i = 0; i < count; ++i)
    if (end[i].x != float(i) || std::fabs(end[i].y - height) > 1e-5f) {
      std::printf("wrong: particle %d is at (%g, %g)\n", int(i), end[i].x,
                  end[i].y);
      return 1;
    }
  std::printf("%d particles at height %.4f on %s\n", int(count), height,
              warp::deviceInfo(device).alias.c_str());

  // The same kernel on memory that the program owns, without a copy.
  if (device == warp::cpuDevice)
    warp::launch(*integrate, device, {count}, warp::view(start.data(), {count}),
                 warp::view(still.data(), {count}), Vec3{0.0f, 0.0f, 0.0f}, dt);
  return 0;
}

int main(int argc, char **argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: integrate MODULE.warp [DEVICE]\n");
    return 2;
  }
  try {
    return run(argv[1], argc > 2 ? std::atoi(argv[2]) : warp::cpuDevice);
  } catch (const warp::Error &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
