// A grid of the voxels of a spherical shell by NanoVDB's GridBuilder, on one
// thread. `benchmarks/voxels.py` builds the same with `wp.Volume`.
//
//   clang++ -O2 -march=native benchmarks/voxels.cpp -o voxels && ./voxels

#include <nanovdb/util/GridBuilder.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

int main() {
  constexpr int radius = 180, inner = radius - 2;
  std::vector<nanovdb::Coord> voxels;
  for (int x = -radius; x <= radius; ++x)
    for (int y = -radius; y <= radius; ++y)
      for (int z = -radius; z <= radius; ++z)
        if (int square = x * x + y * y + z * z;
            square <= radius * radius && square > inner * inner)
          voxels.emplace_back(x, y, z);
  double best = 1e9;
  for (int i = 0; i < 5; ++i) {
    auto start = std::chrono::steady_clock::now();
    nanovdb::GridBuilder<float> builder(0.0f);
    auto accessor = builder.getAccessor();
    for (const nanovdb::Coord &voxel : voxels)
      accessor.setValue(voxel, 1.0f);
    auto handle = builder.getHandle();
    std::chrono::duration<double> time =
        std::chrono::steady_clock::now() - start;
    best = std::min(best, time.count());
  }
  std::printf("%zu voxels: %.1f ms\n", voxels.size(), best * 1e3);
}
