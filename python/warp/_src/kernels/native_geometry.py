"""Meshes as C++ snippets of users find them in namespace `wp`: queries, arrays, the root's box.

Searches are calls of the device library, which is linked with what calls it. The hierarchy has
nodes of up to eight children, so to a snippet the root is a leaf that holds all faces; queries take
it as a root.
"""

from warp._src.device_table import DECLARATIONS, KINDS

RAYS = """namespace wp {
/// True if a ray meets a triangle, watertight along edges; u and v are the weights of a and b.
inline bool intersect_ray_tri_woop(const vec3 &p, const vec3 &dir, const vec3 &a, const vec3 &b,
                                   const vec3 &c, float &t, float &u, float &v, float &sign,
                                   vec3 *normal) {
  int z = int(argmax(abs(dir))), x = (z + 1) % 3, y = (x + 1) % 3;
  if (dir.c[z] < 0) {
    int other = x;
    x = y;
    y = other;
  }
  float slope_x = dir.c[x] / dir.c[z], slope_y = dir.c[y] / dir.c[z];
  vec3 corner[3] = {a - p, b - p, c - p};
  // What shears the ray onto the axis; products of such numbers are exact.
  double sx[3], sy[3];
  for (int i = 0; i < 3; ++i) {
    sx[i] = corner[i].c[x] - slope_x * corner[i].c[z];
    sy[i] = corner[i].c[y] - slope_y * corner[i].c[z];
  }
  double w[3];
  for (int i = 0; i < 3; ++i) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    w[i] = sx[k] * sy[j] - sy[k] * sx[j];
  }
  if ((w[0] < 0 || w[1] < 0 || w[2] < 0) && (w[0] > 0 || w[1] > 0 || w[2] > 0))
    return false;
  double all = w[0] + w[1] + w[2];
  if (all == 0)
    return false;
  double along = 0;
  for (int i = 0; i < 3; ++i)
    along += w[i] / all * corner[i].c[z];
  along /= dir.c[z];
  if (!(along >= 0))
    return false;
  t = float(along);
  u = float(w[0] / all);
  v = float(w[1] / all);
  sign = all > 0 ? 1.0f : -1.0f;
  if (normal)
    *normal = cross(b - a, c - a);
  return true;
}
} // namespace wp
"""

MESHES = (
    DECLARATIONS
    + f"constexpr int32_t warp_native_kind_of_mesh = {KINDS['Mesh']};\n"
    + """namespace warp_native {
/// As lib/DeviceLib/geometry/Tree.h has them.
struct Node {
  float low[3][8], high[3][8];
  uint32_t unused[16];
};
struct Slot {
  uint64_t tag;
  const Node *nodes;
  const void *blocks;
  float scale;
  int32_t count;
  wp::array_t<wp::vec3> points, velocities;
  wp::array_t<int> indices;
};
inline const Slot &slot_of(uint64_t id) {
  uint64_t found;
  warp_slot(id, warp_native_kind_of_mesh, &found);
  return *(const Slot *)found;
}
} // namespace warp_native
namespace wp {
struct BVHPackedNodeHalf {
  float x, y, z;
  unsigned i : 31;
  unsigned b : 1;
};
struct bvh_bounds_t {
  const warp_native::Node *nodes = nullptr;
  float scale = 1;
  bool upper = false;
};
struct bvh_root_t {
  int value = -1;
  int operator*() const { return value; }
};
struct BVH {
  bvh_bounds_t node_lowers, node_uppers;
  bvh_root_t root;
  int num_nodes = 0;
};
inline BVHPackedNodeHalf bvh_load_node(const bvh_bounds_t &bounds, int index) {
  const warp_native::Node &node = bounds.nodes[index];
  float found[3];
  for (int axis = 0; axis < 3; ++axis) {
    const float *side = bounds.upper ? node.high[axis] : node.low[axis];
    // Children that are not there are NaN.
    float extreme = NAN;
    for (int i = 0; i < 8; ++i)
      extreme = bounds.upper ? fmaxf(extreme, side[i]) : fminf(extreme, side[i]);
    found[axis] = extreme / bounds.scale;
  }
  return {found[0], found[1], found[2], 0, 1};
}
struct Mesh {
  array_t<vec3> points, velocities;
  array_t<int> indices;
  int num_points = 0, num_tris = 0;
  BVH bvh;
};
inline Mesh mesh_get(uint64_t id) {
  const warp_native::Slot &slot = warp_native::slot_of(id);
  Mesh mesh;
  mesh.points = slot.points;
  mesh.velocities = slot.velocities;
  mesh.indices = slot.indices;
  mesh.num_points = slot.points.shape[0];
  mesh.num_tris = slot.indices.shape[0] / 3;
  mesh.bvh.node_lowers = {slot.nodes, slot.scale, false};
  mesh.bvh.node_uppers = {slot.nodes, slot.scale, true};
  mesh.bvh.root.value = slot.nodes ? 0 : -1;
  return mesh;
}
inline uint64_t mesh_get_bvh(uint64_t id) { return id; }
inline int mesh_get_index(uint64_t id, int i) { return mesh_get(id).indices[i]; }
inline vec3 mesh_get_point(uint64_t id, int i) {
  Mesh mesh = mesh_get(id);
  return mesh.points[mesh.indices[i]];
}
inline vec3 mesh_get_velocity(uint64_t id, int i) {
  Mesh mesh = mesh_get(id);
  return mesh.velocities[mesh.indices[i]];
}
inline vec3 mesh_eval_position(uint64_t id, int face, float u, float v) {
  return mesh_get_point(id, 3 * face) * u + mesh_get_point(id, 3 * face + 1) * v +
         mesh_get_point(id, 3 * face + 2) * (1.0f - u - v);
}
inline vec3 mesh_eval_velocity(uint64_t id, int face, float u, float v) {
  return mesh_get_velocity(id, 3 * face) * u + mesh_get_velocity(id, 3 * face + 1) * v +
         mesh_get_velocity(id, 3 * face + 2) * (1.0f - u - v);
}
inline vec3 mesh_eval_face_normal(uint64_t id, int face) {
  vec3 a = mesh_get_point(id, 3 * face);
  vec3 b = mesh_get_point(id, 3 * face + 1), c = mesh_get_point(id, 3 * face + 2);
  return normalize(cross(b - a, c - a));
}
struct mesh_query_point_t {
  bool result = false;
  float sign = 0;
  int face = -1;
  float u = 0, v = 0;
};
inline mesh_query_point_t mesh_query_point_no_sign(uint64_t id, const vec3 &p, float max_dist) {
  struct {
    int face;
    float u, v;
  } found;
  warp_mesh_closest(id, p.c[0], p.c[1], p.c[2], max_dist, &found);
  return {found.face >= 0, 0, found.face, found.u, found.v};
}
inline mesh_query_point_t mesh_query_point(uint64_t id, const vec3 &p, float max_dist) {
  mesh_query_point_t found = mesh_query_point_no_sign(id, p, max_dist);
  if (found.result)
    warp_mesh_side(id, p.c[0], p.c[1], p.c[2], &found.sign);
  return found;
}
inline mesh_query_point_t mesh_query_point_sign_normal(uint64_t id, const vec3 &p, float max_dist,
                                                       float epsilon = 1e-3f) {
  struct {
    int face;
    float u, v, sign;
  } found;
  warp_mesh_closest_signed(id, p.c[0], p.c[1], p.c[2], max_dist, epsilon, &found);
  return {found.face >= 0, found.sign, found.face, found.u, found.v};
}
inline mesh_query_point_t mesh_query_point_sign_parity(uint64_t id, const vec3 &p, float max_dist,
                                                       int n_sample = 1,
                                                       float perturbation_scale = 0.1f) {
  mesh_query_point_t found = mesh_query_point_no_sign(id, p, max_dist);
  if (found.result)
    warp_mesh_side_parity(id, p.c[0], p.c[1], p.c[2], n_sample, perturbation_scale, &found.sign);
  return found;
}
inline mesh_query_point_t mesh_query_point_sign_winding_number(uint64_t id, const vec3 &p,
                                                               float max_dist,
                                                               float accuracy = 2.0f,
                                                               float threshold = 0.5f) {
  mesh_query_point_t found = mesh_query_point_no_sign(id, p, max_dist);
  if (found.result)
    warp_mesh_side_winding(id, p.c[0], p.c[1], p.c[2], accuracy, threshold, &found.sign);
  return found;
}
struct mesh_query_ray_t {
  bool result = false;
  float sign = 0;
  int face = -1;
  float t = 0, u = 0, v = 0;
  vec3 normal;
};
inline mesh_query_ray_t mesh_query_ray(uint64_t id, const vec3 &p, const vec3 &dir, float max_t,
                                       int root = -1) {
  struct {
    int face;
    float u, v, t;
  } found;
  warp_mesh_ray(id, p.c[0], p.c[1], p.c[2], dir.c[0], dir.c[1], dir.c[2], max_t, root, &found);
  mesh_query_ray_t result;
  if (found.face < 0)
    return result;
  result.result = true;
  result.face = found.face;
  result.t = found.t;
  result.u = found.u;
  result.v = found.v;
  result.normal = mesh_eval_face_normal(id, found.face);
  result.sign = dot(result.normal, dir) < 0 ? 1.0f : -1.0f;
  return result;
}
} // namespace wp
"""
)
