//===- PlanTileMemory.cpp - Shared memory, by liveness of tiles -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operations are numbered in program order. A class of tiles lives from the
// first operation that makes one of them to the last that reads one, and to the
// end of a loop around a read if it was there before the loop. Tiles that live
// at the same time are disjoint: largest first, each at the lowest free place.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "TensorMapAttributes.h"
#include "TileBuffers.h"

#include "mlir/Interfaces/LoopLikeInterface.h"
#include "llvm/Support/MathExtras.h"

namespace warp {
#define GEN_PASS_DEF_PLANTILEMEMORY
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

/// Widest access that code may make of it, and a pattern of swizzled rows.
constexpr int64_t alignment = 64, patternBytes = 1024;

int64_t warp::getDynamicBytes(Operation *kernel) {
  auto bytes = kernel->getAttrOfType<IntegerAttr>(warp::attr::blockBytes);
  return bytes && bytes.getInt() > staticBlockBytes ? bytes.getInt() : 0;
}

namespace {

/// A piece of memory and when it is in use.
struct Piece {
  int64_t first, last, bytes, offset = -1;
  /// A tile of it, or the operation that needs it.
  Value tile;
  Operation *op = nullptr;

  int64_t getAlignment() const {
    bool inPatterns = tile && (getLayout(tile).getSwizzled() ||
                               getLayout(tile).getTensorMap() != 0);
    return inPatterns ? patternBytes : alignment;
  }
  bool overlaps(const Piece &other) const {
    return first <= other.last && other.first <= last;
  }
};

class Planner {
public:
  Planner(FunctionOpInterface kernel, int64_t threads)
      : kernel(kernel), buffers(kernel) {
    int64_t next = 0;
    number(kernel, next);
    collectTiles();
    kernel->walk([&](Operation *op) {
      auto tileOp = dyn_cast<TileOpInterface>(op);
      int64_t bytes = tileOp ? tileOp.getScratchBytes(threads) : 0;
      if (bytes)
        pieces.push_back({begins[op], ends[op], bytes, -1, {}, op});
    });
  }

  /// The pieces, the largest first, those of one size in their order.
  SmallVector<Piece *> bySize() {
    SmallVector<Piece *> order;
    for (Piece &piece : pieces)
      order.push_back(&piece);
    llvm::sort(order, [](const Piece *a, const Piece *b) {
      return a->bytes != b->bytes ? a->bytes > b->bytes : a < b;
    });
    return order;
  }

  /// Gives each piece its offset; returns the bytes of all.
  int64_t place() {
    SmallVector<Piece *> order = bySize();
    int64_t total = 0;
    for (size_t i = 0; i < order.size(); ++i) {
      SmallVector<Piece *> others;
      for (Piece *other : ArrayRef(order).take_front(i))
        if (other->overlaps(*order[i]))
          others.push_back(other);
      llvm::sort(others, [](const Piece *a, const Piece *b) {
        return a->offset < b->offset;
      });
      int64_t offset = 0;
      for (Piece *other : others)
        if (other->offset < offset + order[i]->bytes)
          offset = std::max<int64_t>(offset,
                                     llvm::alignTo(other->offset + other->bytes,
                                                   order[i]->getAlignment()));
      order[i]->offset = offset;
      total = std::max(total, offset + order[i]->bytes);
    }
    return llvm::alignTo(total, alignment);
  }

  void annotate() {
    llvm::DenseMap<Value, int64_t> offsetOf;
    Builder b(kernel.getContext());
    for (Piece &piece : pieces)
      if (piece.op)
        piece.op->setAttr(tiles::attr::scratch,
                          b.getI64IntegerAttr(piece.offset));
      else
        offsetOf[piece.tile] = piece.offset;
    kernel->walk([&](Operation *op) {
      SmallVector<int64_t> offsets;
      for (Value result : op->getResults())
        if (isTile(result) && !isInline(op))
          offsets.push_back(offsetOf.lookup(buffers.rootOf(result)));
      if (!offsets.empty())
        op->setAttr(tiles::attr::offsets, b.getDenseI64ArrayAttr(offsets));
    });
  }

  InFlightDiagnostic report(int64_t total, int64_t most) {
    auto diagnostic = kernel.emitError()
                      << "tiles need " << total
                      << " bytes of shared memory, which has " << most
                      << "; make them smaller";
    SmallVector<Piece *> order = bySize();
    for (const Piece *piece : ArrayRef(order).take_front(3))
      if (piece->tile)
        diagnostic.attachNote(piece->tile.getLoc())
            << "'" << getPythonName(piece->tile.getType()) << "' needs "
            << piece->bytes << " bytes";
    return diagnostic;
  }

private:
  void number(Operation *op, int64_t &next) {
    begins[op] = next++;
    for (Region &region : op->getRegions())
      for (Block &block : region)
        for (Operation &nested : block)
          number(&nested, next);
    ends[op] = next++;
  }

  void extend(Piece &piece, Operation *op) {
    piece.last = std::max(piece.last, ends[op]);
    for (Operation *around = op->getParentOp(); around && around != kernel;
         around = around->getParentOp())
      if (isa<LoopLikeOpInterface>(around) && piece.first <= begins[around])
        piece.last = std::max(piece.last, ends[around]);
  }

  void collectTiles() {
    llvm::MapVector<Value, SmallVector<Value>> byRoot;
    for (Value tile : buffers.getTiles())
      if (!buffers.isInRegisters(tile))
        byRoot[buffers.rootOf(tile)].push_back(tile);
    for (auto &[root, members] : byRoot) {
      Piece piece{INT64_MAX, 0, getStagedBytes(root), -1, root};
      auto makerOf = [](Value tile) {
        Operation *op = tile.getDefiningOp();
        return op ? op : tile.getParentBlock()->getParentOp();
      };
      for (Value tile : members)
        piece.first = std::min(piece.first, begins[makerOf(tile)]);
      // Stages are there throughout the pipelined loop.
      if (getLayout(root).getStages() > 1)
        piece.first = begins[makerOf(root)->getParentOp()];
      for (Value tile : members) {
        extend(piece, makerOf(tile));
        for (Operation *reader : getReaders(tile))
          extend(piece, reader);
      }
      pieces.push_back(piece);
    }
  }

  FunctionOpInterface kernel;
  TileBuffers buffers;
  llvm::DenseMap<Operation *, int64_t> begins, ends;
  SmallVector<Piece> pieces;
};

LogicalResult plan(FunctionOpInterface kernel, int64_t threads) {
  Planner planner(kernel, threads);
  int64_t total = planner.place();
  int64_t most = getTarget(kernel).getSharedBytes();
  if (total > most) {
    planner.report(total, most);
    return failure();
  }
  planner.annotate();
  kernel->setAttr(warp::attr::blockBytes,
                  Builder(kernel.getContext()).getI64IntegerAttr(total));
  return success();
}

struct PlanTileMemory : warp::impl::PlanTileMemoryBase<PlanTileMemory> {
  void runOnOperation() override {
    if (failed(forTileKernel(getOperation(), plan)))
      signalPassFailure();
  }
};

} // namespace
