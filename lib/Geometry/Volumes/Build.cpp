//===- Build.cpp - NanoVDB grid serialisation -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Kernels write the same bytes (python/warp/_src/geometry/device/voxels.py).
//
//===----------------------------------------------------------------------===//

#include "Build.h"

#include "warp/Error.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

using namespace warp;
using namespace warp::geometry;

void warp::invertMatrix(const double (&matrix)[9], double (&inverse)[9]) {
  // Gauss and Jordan with the largest pivot of a column: the inverse of a
  // diagonal matrix is exact.
  double rows[3][6];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 6; ++j)
      rows[i][j] = j < 3 ? matrix[3 * i + j] : j - 3 == i;
  for (int column = 0; column < 3; ++column) {
    int pivot = column;
    for (int i = column + 1; i < 3; ++i)
      if (std::fabs(rows[i][column]) > std::fabs(rows[pivot][column]))
        pivot = i;
    std::swap(rows[pivot], rows[column]);
    double divisor = rows[column][column];
    for (double &entry : rows[column])
      entry /= divisor;
    for (int i = 0; i < 3; ++i) {
      double factor = rows[i][column];
      if (i == column || factor == 0)
        continue;
      for (int j = 0; j < 6; ++j)
        rows[i][j] -= factor * rows[column][j];
    }
  }
  for (int i = 0; i < 3; ++i)
    std::copy_n(rows[i] + 3, 3, inverse + 3 * i);
}

namespace {

/// Writes the parts of a grid, each behind the one before it.
class Filler {
public:
  Filler(const VoxelTopology &topology, const GridRecipe &recipe,
         const std::vector<LeafHead> *masks);
  GridBytes take() && { return std::move(bytes); }

private:
  void fillHeader();
  void fillTree();
  void fillBoxes();
  void fillRoot();
  void fillInner(int64_t at, const std::vector<Int3> &nodes, int64_t size,
                 int64_t table, int64_t cells, int64_t edge);
  void link(int64_t at, int64_t size, int64_t table, int64_t cells,
            const std::vector<uint32_t> &parents,
            const std::vector<Int3> &children, int64_t childAt,
            int64_t childSize, int shift, int bits);
  void fillLeaves();
  uint8_t *at(int64_t offset) { return bytes.data() + offset; }

  const VoxelTopology &topology;
  const GridRecipe &recipe;
  const std::vector<LeafHead> *masks;
  VoxelType type;
  GridLayout layout;
  std::vector<uint8_t> background;
  bool isZero;
  int64_t leafCount, lowerCount, upperCount;
  int64_t upperAt, lowerAt, leafAt;
  GridBytes bytes;
};

} // namespace

static VoxelType typeOf(const GridRecipe &recipe) {
  return recipe.ofVoxels ? VoxelType::OnIndex : recipe.type;
}

/// The background of a recipe, as many bytes as a value has.
static std::vector<uint8_t> backgroundOf(const GridRecipe &recipe,
                                         int64_t size) {
  if (recipe.ofVoxels || recipe.background.empty())
    return std::vector<uint8_t>(size);
  if (int64_t(recipe.background.size()) != size)
    throw Error(Error::Kind::Value,
                "a background of " + std::to_string(recipe.background.size()) +
                    " bytes, but a value of the grid has " +
                    std::to_string(size));
  return recipe.background;
}

Filler::Filler(const VoxelTopology &topology, const GridRecipe &recipe,
               const std::vector<LeafHead> *masks)
    : topology(topology), recipe(recipe), masks(masks), type(typeOf(recipe)),
      layout(gridLayout(type)), background(backgroundOf(recipe, layout.value)),
      isZero(std::all_of(background.begin(), background.end(),
                         [](uint8_t byte) { return byte == 0; })),
      leafCount(int64_t(topology.leaves.size())),
      lowerCount(int64_t(topology.lowers.size())),
      upperCount(int64_t(topology.uppers.size())),
      upperAt(layout.rootAt + layout.root + upperCount * layout.tile),
      lowerAt(upperAt + upperCount * layout.upper),
      leafAt(lowerAt + lowerCount * layout.lower),
      bytes(size_t(leafAt + leafCount * layout.leaf)) {
  fillHeader();
  fillTree();
  fillRoot();
  fillInner(upperAt, topology.uppers, layout.upper, layout.upperTable,
            upperCells, 4096);
  link(upperAt, layout.upper, layout.upperTable, upperCells, topology.upperOf,
       topology.lowers, lowerAt, layout.lower, 7, 5);
  fillInner(lowerAt, topology.lowers, layout.lower, layout.lowerTable,
            lowerCells, 128);
  link(lowerAt, layout.lower, layout.lowerTable, lowerCells, topology.lowerOf,
       topology.leaves, leafAt, layout.leaf, 3, 4);
  fillLeaves();
  fillBoxes();
}

void Filler::fillHeader() {
  constexpr uint32_t hasBox = 1 << 1;
  constexpr uint32_t indexClass = 8;
  GridHeader header{};
  header.magic = gridMagics[0];
  header.checksum = ~uint64_t(0);
  header.version = writtenVersion;
  header.flags = hasBox | isBreadthFirst;
  header.count = 1;
  header.size = bytes.size();
  const double (&matrix)[9] = recipe.transform.matrix;
  std::copy_n(matrix, 9, header.matrix);
  invertMatrix(header.matrix, header.inverse);
  std::copy_n(recipe.transform.shift, 3, header.shift);
  std::copy_n(header.matrix, 9, header.single);
  std::copy_n(header.inverse, 9, header.singleInverse);
  std::copy_n(header.shift, 3, header.singleShift);
  header.taper = header.singleTaper = 1;
  // As NanoVDB has it: where a step of one voxel along all axes leads.
  for (int i = 0; i < 3; ++i)
    header.voxelSize[i] = matrix[3 * i] + matrix[3 * i + 1] + matrix[3 * i + 2];
  header.type = uint32_t(type);
  header.gridClass = isIndex(header.type) ? indexClass : 0;
  store(at(0), header);
}

void Filler::fillTree() {
  GridTree tree{};
  int64_t start = sizeof(GridHeader);
  tree.offsets[0] = leafAt - start;
  tree.offsets[1] = lowerAt - start;
  tree.offsets[2] = upperAt - start;
  tree.offsets[3] = layout.rootAt - start;
  tree.counts[0] = uint32_t(leafCount);
  tree.counts[1] = uint32_t(lowerCount);
  tree.counts[2] = uint32_t(upperCount);
  tree.voxels = uint64_t(leafCount) * leafCells;
  if (masks) {
    tree.voxels = 0;
    for (const LeafHead &head : *masks)
      for (uint64_t word : head.values)
        tree.voxels += std::popcount(word);
  }
  store(at(start), tree);
}

void Filler::fillRoot() {
  store(at(layout.rootAt + 24), uint32_t(upperCount));
  std::copy(background.begin(), background.end(),
            at(layout.rootAt + layout.background));
  for (int64_t i = 0; i < upperCount; ++i) {
    uint64_t key = 0;
    for (int32_t x : topology.uppers[i].at)
      key = key << 21 | (uint64_t(x >> 12) & 0xFFFFF);
    uint8_t *tile = at(layout.rootAt + layout.root + i * layout.tile);
    store(tile, key);
    store(tile + 8, int64_t(upperAt - layout.rootAt + i * layout.upper));
  }
}

/// Boxes, and the background where no child is.
void Filler::fillInner(int64_t start, const std::vector<Int3> &nodes,
                       int64_t size, int64_t table, int64_t cells,
                       int64_t edge) {
  for (size_t i = 0; i < nodes.size(); ++i) {
    uint8_t *node = at(start + int64_t(i) * size);
    InnerHead head{};
    for (int axis = 0; axis < 3; ++axis) {
      head.box[axis] = nodes[i].at[axis];
      head.box[3 + axis] = int32_t(nodes[i].at[axis] + edge - 1);
    }
    store(node, head);
    for (int64_t cell = 0; !isZero && cell < cells; ++cell)
      std::copy(background.begin(), background.end(),
                node + table + cell * layout.entry);
  }
}

/// The masks of parents, and offsets of children, each from its parent.
void Filler::link(int64_t start, int64_t size, int64_t table, int64_t cells,
                  const std::vector<uint32_t> &parents,
                  const std::vector<Int3> &children, int64_t childAt,
                  int64_t childSize, int shift, int bits) {
  for (size_t i = 0; i < children.size(); ++i) {
    uint8_t *node = at(start + parents[i] * size);
    uint32_t cell = cellOf(children[i], shift, bits);
    node[int64_t(sizeof(InnerHead)) + cells / 8 + cell / 8] |= 1 << cell % 8;
    uint8_t *entry = node + table + cell * layout.entry;
    std::fill_n(entry, layout.entry, 0);
    store(entry, childAt + int64_t(i) * childSize - (node - bytes.data()));
  }
}

void Filler::fillLeaves() {
  constexpr uint8_t hasBox = 1 << 1;
  LeafNumbers numbers{1, 0};
  for (int64_t i = 0; i < leafCount; ++i) {
    uint8_t *leaf = at(leafAt + i * layout.leaf);
    LeafHead head{{}, {7, 7, 7}, hasBox, {}};
    std::copy_n(topology.leaves[i].at, 3, head.origin);
    std::fill_n(head.values, 8, ~uint64_t(0));
    uint64_t count = leafCells;
    if (masks) {
      std::copy_n((*masks)[i].values, 8, head.values);
      numbers.sums = count = 0;
      for (int word = 0; word < 8; ++word) {
        count += std::popcount(head.values[word]);
        if (word < 7)
          numbers.sums |= count << 9 * word;
      }
    }
    store(leaf, head);
    if (isIndex(uint32_t(type))) {
      store(leaf + layout.leafTable, numbers);
      numbers.first += count;
    } else if (!isZero) {
      for (int64_t n = 0; n < leafCells; ++n)
        std::copy(background.begin(), background.end(),
                  leaf + layout.leafTable + n * layout.value);
    }
  }
}

/// The box of all leaves, in index space and in the world.
void Filler::fillBoxes() {
  int32_t box[6];
  std::fill_n(box, 3, std::numeric_limits<int32_t>::max());
  std::fill_n(box + 3, 3, std::numeric_limits<int32_t>::min());
  for (const Int3 &leaf : topology.leaves)
    for (int axis = 0; axis < 3; ++axis) {
      box[axis] = std::min(box[axis], leaf.at[axis]);
      box[3 + axis] = std::max(box[3 + axis], leaf.at[axis] + 7);
    }
  std::memcpy(at(layout.rootAt), box, sizeof box);
  if (!leafCount)
    return;
  auto header = load<GridHeader>(at(0));
  for (int corner = 0; corner < 8; ++corner) {
    double index[3];
    for (int axis = 0; axis < 3; ++axis)
      index[axis] = corner >> axis & 1 ? double(box[3 + axis]) + 1 : box[axis];
    for (int axis = 0; axis < 3; ++axis) {
      const double *row = header.matrix + 3 * axis;
      double x = row[0] * index[0] + row[1] * index[1] + row[2] * index[2] +
                 header.shift[axis];
      double &low = header.worldBox[axis], &high = header.worldBox[3 + axis];
      low = corner ? std::min(low, x) : x;
      high = corner ? std::max(high, x) : x;
    }
  }
  store(at(0), header);
}

GridBytes warp::geometry::fillGrid(const VoxelTopology &topology,
                                   const GridRecipe &recipe,
                                   const std::vector<LeafHead> *masks) {
  return Filler(topology, recipe, masks).take();
}
