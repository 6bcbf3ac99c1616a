//===- Quantised.cpp - Grids whose voxels are numbers of a few bits -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Quantised.h"

#include "Levels.h"

#include <algorithm>

using namespace warp;
using namespace warp::geometry;

namespace {

/// The header of a leaf of few bits; its numbers follow.
struct QuantisedHead {
  LeafHead head;
  float minimum, quantum;
  uint16_t statistics[4];
};
static_assert(sizeof(QuantisedHead) == 96);

/// A leaf of few bits, where it is and how wide its numbers are.
struct QuantisedLeaf {
  int64_t at;
  int bits;

  int64_t end() const {
    return at + int64_t(sizeof(QuantisedHead)) + 64 * bits;
  }
};

/// An entry of a lower node that leads to a leaf.
struct Link {
  int64_t parent, place, leaf;
};

constexpr uint32_t fp4 = 13, fpN = 16;
/// The place of the width of FpN: the logarithm, in a leaf's flags.
constexpr int widthShift = 5;

/// Replaces the leaves of one grid.
class Expansion {
public:
  explicit Expansion(const GridBytes &grid);
  GridBytes run();

private:
  void findLeaves();
  void writeLeaf(const QuantisedLeaf &leaf, uint8_t *made) const;
  void relink(GridBytes &whole, int64_t leafAt) const;
  void describe(GridBytes &whole, int64_t leafAt, int64_t moved) const;

  GridBytes grid;
  Levels above;
  std::vector<Link> links;
  std::vector<QuantisedLeaf> leaves;
};

} // namespace

static bool isQuantised(uint32_t type) { return type >= fp4 && type <= fpN; }

Expansion::Expansion(const GridBytes &grid)
    : grid(grid),
      above(this->grid.data(), this->grid.size(), VoxelType::Float) {
  findLeaves();
}

void Expansion::findLeaves() {
  above.forChildren(above.lowers, lowerCells, above.layout.lowerTable,
                    [&](int64_t parent, int64_t place, int64_t child) {
                      links.push_back({parent, place, child});
                    });
  std::vector<int64_t> found;
  for (const Link &link : links)
    found.push_back(link.leaf);
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  if (found.size() != above.tree.counts[0])
    throw broken("it says it has " + std::to_string(above.tree.counts[0]) +
                 " leaves, but its nodes have " + std::to_string(found.size()));
  if (found.empty())
    return;
  int64_t last = above.size - int64_t(sizeof(QuantisedHead));
  if (found.front() < above.endAbove() || found.back() > last)
    throw broken("a leaf is not behind its other nodes");
  for (size_t i = 0; i < found.size(); ++i) {
    auto head = load<LeafHead>(grid.data() + found[i]);
    QuantisedLeaf leaf{found[i], 0};
    if (above.header.type == fpN)
      leaf.bits = 1 << (head.flags >> widthShift);
    else
      leaf.bits = 4 << (above.header.type - fp4);
    if (leaf.bits > 16)
      throw broken("a leaf has voxels of more than 16 bits");
    if (leaf.end() > (i + 1 < found.size() ? found[i + 1] : above.size))
      throw broken("a leaf is not within its bytes");
    leaves.push_back(leaf);
  }
}

void Expansion::writeLeaf(const QuantisedLeaf &leaf, uint8_t *made) const {
  const uint8_t *from = grid.data() + leaf.at;
  auto head = load<QuantisedHead>(from);
  head.head.flags &= (1 << widthShift) - 1;
  store(made, head.head);
  const uint8_t *numbers = from + sizeof head;
  uint8_t *values = made + above.layout.leafTable;
  uint32_t mask = (1u << leaf.bits) - 1;
  for (int n = 0; n < leafCells; ++n) {
    int bit = n * leaf.bits;
    uint32_t number = leaf.bits == 16 ? load<uint16_t>(numbers + 2 * n)
                                      : numbers[bit >> 3] >> (bit & 7) & mask;
    store(values + 4 * n, float(number) * head.quantum + head.minimum);
  }
}

/// Lets the entries of lower nodes lead to the new leaves.
void Expansion::relink(GridBytes &whole, int64_t leafAt) const {
  for (const Link &link : links) {
    auto leaf = std::lower_bound(
        leaves.begin(), leaves.end(), link.leaf,
        [](const QuantisedLeaf &a, int64_t at) { return a.at < at; });
    int64_t node = above.lowers.at + link.parent * above.lowers.size;
    int64_t entry =
        node + above.layout.lowerTable + link.place * above.layout.entry;
    int64_t made = leafAt + (leaf - leaves.begin()) * above.layout.leaf;
    store(whole.data() + entry, made - node);
  }
}

void Expansion::describe(GridBytes &whole, int64_t leafAt,
                         int64_t moved) const {
  GridHeader header = above.header;
  header.type = uint32_t(VoxelType::Float);
  header.size = whole.size();
  // Nobody checks a sum that is all ones.
  header.checksum = ~uint64_t(0);
  if (header.blindOffset &&
      __builtin_add_overflow(header.blindOffset, moved, &header.blindOffset))
    throw broken("its arrays are not within its bytes");
  store(whole.data(), header);
  GridTree tree = above.tree;
  tree.offsets[0] = leafAt - int64_t(sizeof header);
  store(whole.data() + sizeof header, tree);
}

GridBytes Expansion::run() {
  int64_t ends = above.endAbove();
  int64_t leafAt = roundUp(ends, 32);
  int64_t body = leafAt + int64_t(leaves.size()) * above.layout.leaf;
  // The data after the leaves, such as arrays beside the grid.
  int64_t tailAt = leaves.empty() ? ends : leaves.back().end();
  if (above.header.blindOffset > 0 && above.header.blindOffset < tailAt)
    throw broken("its arrays overlap its nodes");
  int64_t tail = above.size - tailAt;
  GridBytes whole(size_t(roundUp(body + tail, 32)));
  std::memcpy(whole.data(), grid.data(), ends);
  for (size_t i = 0; i < leaves.size(); ++i)
    writeLeaf(leaves[i],
              whole.data() + leafAt + int64_t(i) * above.layout.leaf);
  std::memcpy(whole.data() + body, grid.data() + tailAt, tail);
  relink(whole, leafAt);
  describe(whole, leafAt, body - tailAt);
  return whole;
}

/// The bytes of each grid, without a copy; the rest is behind the last.
static std::vector<GridBytes> splitGrids(const GridBytes &grids) {
  std::vector<GridBytes> parts;
  size_t start = 0;
  while (start < grids.size()) {
    size_t left = grids.size() - start;
    GridHeader header = headerOf(grids.data() + start, left);
    if (header.size <= sizeof(GridHeader) || header.size > left)
      throw broken("it says it has " + std::to_string(header.size) +
                   " bytes, but there are " + std::to_string(left));
    parts.push_back(grids.part(start, header.size));
    start += header.size;
    if (uint64_t(header.index) + 1 >= header.count)
      break;
  }
  parts.push_back(grids.part(start, grids.size() - start));
  return parts;
}

GridBytes warp::geometry::joinGrids(const std::vector<GridBytes> &parts) {
  size_t size = 0;
  for (const GridBytes &part : parts)
    size += part.size();
  GridBytes all(size);
  uint8_t *end = all.data();
  for (const GridBytes &part : parts)
    end = std::copy_n(part.data(), part.size(), end);
  return all;
}

GridBytes warp::geometry::expandGrids(const GridBytes &grids) {
  std::vector<GridBytes> parts = splitGrids(grids);
  bool hasFound = false;
  for (size_t i = 0; i + 1 < parts.size(); ++i)
    if (isQuantised(load<GridHeader>(parts[i].data()).type)) {
      parts[i] = Expansion(parts[i]).run();
      hasFound = true;
    }
  return hasFound ? joinGrids(parts) : grids;
}
