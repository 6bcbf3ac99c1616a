//===- GeometryScenes.h - Meshes that tests search --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TEST_UNIT_GEOMETRYSCENES_H
#define WARP_TEST_UNIT_GEOMETRYSCENES_H

#include "DeviceLib/geometry/Search.h"
#include "warp/Mesh.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace scenes {

using Vertex = std::array<float, 3>;
using Double3 = std::array<double, 3>;

/// A mesh with the arrays that it was made from.
struct Scene {
  std::vector<Vertex> points;
  std::vector<int32_t> indices;

  size_t faces() const { return indices.size() / 3; }
  const Vertex &corner(size_t face, int i) const {
    return points[indices[3 * face + i]];
  }
  void addTriangle(Vertex a, Vertex b, Vertex c) {
    for (const Vertex &corner : {a, b, c}) {
      indices.push_back(int32_t(points.size()));
      points.push_back(corner);
    }
  }
  warp::MeshArrays arrays() {
    warp::MeshArrays all;
    all.points.data = points.data();
    all.points.shape[0] = int32_t(points.size());
    all.points.strides[0] = sizeof(Vertex);
    all.indices.data = indices.data();
    all.indices.shape[0] = int32_t(indices.size());
    all.indices.strides[0] = sizeof(int32_t);
    all.points.ndim = all.indices.ndim = 1;
    return all;
  }
};

/// The tree in the slot of a handle.
inline const warp::geometry::Tree &treeOf(uint64_t id) {
  return *reinterpret_cast<const warp::geometry::Tree *>(
      id & ((uint64_t(1) << 49) - 1));
}

/// A closed sphere with bumps: a grid of longitudes and latitudes between two
/// poles. Neighbours share vertices.
inline Scene makeSphere(int around, int high, float bumps = 0.1f) {
  Scene scene;
  auto place = [&](double theta, double phi) {
    double x = std::sin(theta) * std::cos(phi);
    double y = std::sin(theta) * std::sin(phi), z = std::cos(theta);
    double r = 1 + bumps * std::sin(7 * x) * std::cos(5 * y);
    scene.points.push_back({float(r * x), float(r * y), float(r * z)});
  };
  place(0, 0);
  for (int i = 1; i < high; ++i)
    for (int j = 0; j < around; ++j)
      place(M_PI * i / high, 2 * M_PI * j / around);
  place(M_PI, 0);
  auto at = [&](int i, int j) {
    return i == 0      ? 0
           : i == high ? int(scene.points.size()) - 1
                       : 1 + (i - 1) * around + j % around;
  };
  auto add = [&](int a, int b, int c) {
    scene.indices.insert(scene.indices.end(), {a, b, c});
  };
  for (int i = 0; i < high; ++i)
    for (int j = 0; j < around; ++j) {
      if (i > 0)
        add(at(i, j), at(i + 1, j), at(i, j + 1));
      if (i < high - 1)
        add(at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
    }
  return scene;
}

/// Triangles anywhere in the unit cube, of a size of about `size`.
inline Scene makeSoup(int count, float size, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> where(-1, 1);
  Scene scene;
  for (int i = 0; i < count; ++i) {
    Vertex center{where(random), where(random), where(random)};
    Vertex corners[3];
    for (Vertex &corner : corners)
      for (int axis = 0; axis < 3; ++axis)
        corner[axis] = center[axis] + size * where(random);
    scene.addTriangle(corners[0], corners[1], corners[2]);
  }
  return scene;
}

/// Needles side by side in the plane z = 0, from -1 to 1 along x and y.
inline Scene makeStrip(int rows) {
  Scene scene;
  for (int i = 0; i < rows; ++i) {
    float low = -1 + 2.0f * i / rows, high = -1 + 2.0f * (i + 1) / rows;
    scene.addTriangle({-1, low, 0}, {1, low, 0}, {1, high, 0});
    scene.addTriangle({-1, low, 0}, {1, high, 0}, {-1, high, 0});
  }
  return scene;
}

inline Double3 minus(Double3 a, Double3 b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline double dot(Double3 a, Double3 b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline Double3 cross(Double3 a, Double3 b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
          a[0] * b[1] - a[1] * b[0]};
}
inline Double3 toDouble(const Vertex &v) { return {v[0], v[1], v[2]}; }

/// Squared distance to a triangle by the regions of Ericson, "Real-Time
/// Collision Detection", section 5.1.5; a reference with other formulas.
inline double squaredDistance(Double3 p, Double3 a, Double3 b, Double3 c) {
  auto toSegment = [&](Double3 s, Double3 e) {
    Double3 d = minus(e, s);
    double length2 = dot(d, d);
    double t = length2 > 0 ? dot(minus(p, s), d) / length2 : 0;
    t = std::fmin(std::fmax(t, 0), 1);
    Double3 q = {s[0] + t * d[0] - p[0], s[1] + t * d[1] - p[1],
                 s[2] + t * d[2] - p[2]};
    return dot(q, q);
  };
  double best =
      std::fmin(toSegment(a, b), std::fmin(toSegment(b, c), toSegment(c, a)));
  Double3 n = cross(minus(b, a), minus(c, a));
  double area2 = dot(n, n);
  bool inside = area2 > 0 && dot(cross(minus(b, a), minus(p, a)), n) >= 0 &&
                dot(cross(minus(c, b), minus(p, b)), n) >= 0 &&
                dot(cross(minus(a, c), minus(p, c)), n) >= 0;
  if (!inside)
    return best;
  double off = dot(minus(p, a), n);
  return std::fmin(best, off * off / area2);
}

inline double squaredDistance(const Scene &scene, const Vertex &p) {
  double best = HUGE_VAL;
  for (size_t f = 0; f < scene.faces(); ++f)
    best = std::fmin(best,
                     squaredDistance(toDouble(p), toDouble(scene.corner(f, 0)),
                                     toDouble(scene.corner(f, 1)),
                                     toDouble(scene.corner(f, 2))));
  return best;
}

} // namespace scenes

#endif // WARP_TEST_UNIT_GEOMETRYSCENES_H
