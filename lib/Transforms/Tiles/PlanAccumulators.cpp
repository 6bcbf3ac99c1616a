//===- PlanAccumulators.cpp - Register accumulators of products -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tile that products of a GPU kernel add to, and that otherwise is only
// stored or copied, has no memory: each thread holds its sums in registers, in
// the layout of the product's form, also throughout loops and branches that
// carry it. A loop that begins with a tile in memory takes it into registers
// first. A loop that loads both factors of a product and does nothing else
// loads those of the next iterations while it multiplies.
//
//===----------------------------------------------------------------------===//

#include "TileProducts.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

namespace {

class AccumulatorPlanner {
public:
  AccumulatorPlanner(FunctionOpInterface kernel, int64_t threads)
      : kernel(kernel), buffers(kernel), threads(threads),
        target(getTarget(kernel)) {}

  void run() {
    SmallVector<TileMatmulOp> products;
    kernel->walk([&](TileMatmulOp op) {
      if (auto form = findProductForm(op, threads, target)) {
        setProductForm(op, *form);
        products.push_back(op);
      }
    });
    takeInits(products);
    llvm::MapVector<Value, SmallVector<Value>> byRoot;
    for (Value tile : buffers.getTiles())
      byRoot[buffers.rootOf(tile)].push_back(tile);
    for (TileMatmulOp op : products)
      multiplyByWarpgroups(op, byRoot[buffers.rootOf(op.getResult())]);
    for (auto &[root, members] : byRoot)
      if (canAccumulate(members))
        accumulate(members);
    dropCopies();
    for (TileMatmulOp op : products)
      if (getLayout(op).getStorage() == TileStorage::accumulators)
        loadAhead(op);
    limitRegisters(products);
  }

private:
  static bool isCarrier(Operation *op) {
    return isa<scf::ForOp, scf::WhileOp, scf::IfOp>(op);
  }

  /// Has loops whose products add to what they carry begin with a copy of it,
  /// if it is in memory: in registers, if these hold it.
  void takeInits(ArrayRef<TileMatmulOp> products) {
    llvm::DenseSet<Value> roots;
    for (TileMatmulOp op : products)
      if (auto operand = op->getAttrOfType<IntegerAttr>(attr::inPlace);
          operand && operand.getInt() == 2)
        roots.insert(buffers.rootOf(op.getResult()));
    kernel->walk([&](LoopLikeOpInterface loop) {
      for (OpOperand &init : loop.getInitsMutable()) {
        Operation *def = init.get().getDefiningOp();
        if (isTile(init.get()) && def && !isCarrier(def) &&
            !isa<TileMatmulOp>(def) && !splatBehind(def) &&
            roots.contains(buffers.rootOf(init.get())))
          copies.insert(copyFor(init.get(), &init));
      }
    });
    // Nobody else reads a view that a loop begins with.
    for (Operation *copy : copies)
      if (auto view = copy->getOperand(0).getDefiningOp<TileReshapeOp>())
        keepView(view, TileStorage::inlined);
    if (!copies.empty())
      buffers = TileBuffers(kernel);
  }

  /// Has a view of packed memory kept, or not.
  static void keepView(TileReshapeOp view, TileStorage storage) {
    TileLayoutAttr layout = getLayout(view);
    setLayout(view, layout.withStorage(TileStorage::inlined));
    if (storage != TileStorage::inlined || !getStrided(view.getResult()))
      setLayout(view, layout.withStorage(TileStorage::memory));
  }

  /// Drops the copies that are in memory.
  void dropCopies() {
    for (Operation *copy : copies)
      if (getLayout(copy).getStorage() != TileStorage::accumulators) {
        if (auto view = copy->getOperand(0).getDefiningOp<TileReshapeOp>())
          keepView(view, TileStorage::memory);
        copy->replaceAllUsesWith(copy->getOperands());
        copy->erase();
      }
  }

  /// If threads can accumulate the sums and the factors are loaded ahead.
  void multiplyByWarpgroups(TileMatmulOp op, ArrayRef<Value> members) {
    auto form = findWarpgroupForm(op, threads, target);
    if (!form || !findAheadLoop(op))
      return;
    ProductForm plain = *getProductForm(op);
    setProductForm(op, *form);
    if (!canAccumulate(members))
      setProductForm(op, plain);
  }

  /// True if an operation can give accumulators: of a product, or a constant.
  bool canStartAccumulators(Value tile,
                            std::optional<std::string> &layout) const {
    Operation *def = tile.getDefiningOp();
    if (!def)
      return isCarrier(tile.getParentBlock()->getParentOp());
    if (auto product = dyn_cast<TileMatmulOp>(def)) {
      auto form = getProductForm(product);
      auto operand = def->getAttrOfType<IntegerAttr>(attr::inPlace);
      bool adds = operand && operand.getInt() == 2;
      // A tile that needs memory anyway is there from the beginning.
      bool isNew = !product.getC() &&
                   llvm::all_of(def->getUsers(), [&](Operation *user) {
                     return usesInPlace(user, tile);
                   });
      // Each product rounds sums of fewer bits.
      if (!form ||
          tileType(tile).getElementType().getIntOrFloatBitWidth() < 32 ||
          (!adds && !isNew) || (layout && *layout != form->layout))
        return false;
      layout = form->layout;
      return true;
    }
    return isCarrier(def) || copies.contains(def) || splatBehind(def);
  }

  /// The number in all elements of what is made, or copied, from a splat.
  static Value splatBehind(Operation *def) {
    if (auto map = dyn_cast<TileMapOp>(def)) {
      Block &body = map.getBody().front();
      if (map.getInputs().size() != 1 || map.getNumResults() != 1 ||
          body.getTerminator()->getOperand(0) != body.getArgument(0) ||
          !isTile(map.getInputs()[0]))
        return Value();
      def = map.getInputs()[0].getDefiningOp();
    }
    auto splat = dyn_cast_or_null<TileSplatOp>(def);
    return splat && splat.getValue().getDefiningOp<ConstantOp>()
               ? splat.getValue()
               : Value();
  }

  bool canStore(Operation *user, Value tile) const {
    auto fits = [&](auto access) {
      return access.getTile() == tile && !access.getPicked() &&
             isPlainWindow(access.getArray(), tileType(tile),
                           access.getOffsets());
    };
    if (auto store = dyn_cast<TileStoreOp>(user))
      return fits(store);
    auto atomic = dyn_cast<TileAtomicOp>(user);
    return atomic && atomic.getKind() == TileUpdate::add &&
           atomic.getOld().use_empty() && fits(atomic) &&
           cast<ArrayType>(atomic.getArray().getType()).getElementType() ==
               tileType(tile).getElementType();
  }

  bool usesInPlace(Operation *user, Value tile) const {
    return isCarrier(user) || user->hasTrait<OpTrait::IsTerminator>() ||
           (isa<TileMatmulOp>(user) && user->hasAttr(attr::inPlace) &&
            cast<TileMatmulOp>(user).getC() == tile) ||
           canStore(user, tile);
  }

  bool canAccumulate(ArrayRef<Value> members) const {
    std::optional<std::string> layout;
    bool isTaken = false;
    for (Value tile : members) {
      if (!canStartAccumulators(tile, layout))
        return false;
      isTaken |= copies.contains(tile.getDefiningOp());
      // Copies stand behind the operation that made the tile.
      if (isa<BlockArgument>(tile) &&
          !llvm::all_of(tile.getUsers(), [&](Operation *user) {
            return usesInPlace(user, tile);
          }))
        return false;
    }
    // Warpgroups have no function that takes sums.
    return layout && !(isTaken && StringRef(*layout).starts_with("wg_"));
  }

  /// Has uses of a tile use a copy of it.
  Operation *copyFor(Value tile, ArrayRef<OpOperand *> uses) {
    OpBuilder b(kernel.getContext());
    b.setInsertionPointAfterValue(tile);
    auto map = TileMapOp::create(b, tile.getLoc(), tile.getType(), tile);
    Block *body = b.createBlock(&map.getBody(), {},
                                tileType(tile).getElementType(), tile.getLoc());
    TileYieldOp::create(b, tile.getLoc(), ValueRange(body->getArgument(0)));
    for (OpOperand *use : uses)
      use->set(map.getResult(0));
    return map;
  }

  /// Others read a copy in memory.
  void copyForOthers(Value tile) {
    SmallVector<OpOperand *> uses;
    for (OpOperand &use : tile.getUses())
      if (!usesInPlace(use.getOwner(), tile))
        uses.push_back(&use);
    if (!uses.empty())
      copyFor(tile, uses);
  }

  void accumulate(ArrayRef<Value> members) {
    for (Value tile : members) {
      Operation *def = tile.getDefiningOp();
      if (def && !isCarrier(def))
        setLayout(def, getLayout(def).withStorage(TileStorage::accumulators));
      if (def)
        copyForOthers(tile);
    }
  }

  //===--------------------------------------------------------------------===//
  // Loading ahead
  //===--------------------------------------------------------------------===//

  /// A tile that is loaded for this product alone.
  bool isOwnLoad(Value tile, TileMatmulOp product) const {
    auto load = tile.getDefiningOp<TileLoadOp>();
    return load && !isInline(load) && !load.getPicked() &&
           load->getBlock() == product->getBlock() &&
           llvm::all_of(getReaders(tile),
                        [&](Operation *op) { return op == product; }) &&
           isPlainWindow(load.getArray(), tileType(tile), load.getOffsets());
  }

  bool isPure(scf::ForOp loop, TileMatmulOp product,
              ArrayRef<Operation *> loads) const {
    if (loop.getNumRegionIterArgs() != 1)
      return false;
    return llvm::all_of(
        loop.getBody()->without_terminator(), [&](Operation &op) {
          bool known = &op == product || llvm::is_contained(loads, &op) ||
                       (computesTiles(&op) && isInline(&op));
          return known || (!computesTiles(&op) && isMemoryEffectFree(&op) &&
                           op.getNumRegions() == 0);
        });
  }

  /// Rows a multiple of 16 bytes apart, an odd one where they are read at a
  /// time, so that they lie in different banks.
  static int64_t padded(TileType type, bool isAlong) {
    // Threads read doubles of four rows.
    if (type.getElementType().isF64())
      return type.getShape()[1] + (type.getShape()[1] % 8 == 0 ? 4 : 0);
    int64_t run = 16 / getByteSize(type.getElementType());
    int64_t runs = type.getShape()[1] / run;
    bool rowsAtATime = isAlong || run == 8;
    return (rowsAtATime && runs % 2 == 0 ? runs + 1 : runs) * run;
  }

  /// The loop that can load factors of its next iterations; null if none can.
  scf::ForOp findAheadLoop(TileMatmulOp product) const {
    if (!target.has(Feature::AsyncCopy))
      return {};
    auto loop = dyn_cast<scf::ForOp>(product->getParentOp());
    std::optional<Factor> a =
        getFactor(product.getA(), product.getTransposeA());
    std::optional<Factor> b =
        getFactor(product.getB(), !product.getTransposeB());
    bool can = loop && loop.getInductionVar().getType().isInteger(32) &&
               a->memory != b->memory && isOwnLoad(a->memory, product) &&
               isOwnLoad(b->memory, product) &&
               isPure(loop, product,
                      {a->memory.getDefiningOp(), b->memory.getDefiningOp()});
    return can ? loop : scf::ForOp();
  }

  void loadAhead(TileMatmulOp product) {
    scf::ForOp loop = findAheadLoop(product);
    if (!loop)
      return;
    ProductForm form = *getProductForm(product);
    planLoads(kernel, loop, product);
    Builder builder(loop.getContext());
    SmallVector<Operation *, 2> loads;
    int64_t bytes = 0;
    for (const Factor &factor :
         {*getFactor(product.getA(), product.getTransposeA()),
          *getFactor(product.getB(), !product.getTransposeB())}) {
      TileType type = tileType(factor.memory);
      loads.push_back(factor.memory.getDefiningOp());
      int64_t pitch = type.getShape()[1];
      if (!form.isByWarpgroups() && getLayout(loads.back()).getTensorMap() == 0)
        pitch = padded(type, factor.isAlong);
      setLayout(loads.back(), getLayout(loads.back()).withPitch(pitch));
      bytes += type.getShape()[0] * pitch * getByteSize(type.getElementType());
    }
    // Two blocks at a time, with what the driver keeps for itself; one, if its
    // sums take the registers of two.
    int64_t blocks =
        form.isByWarpgroups() && form.slots > mostSharedSums ? 1 : 2;
    int64_t room = target.getSharedBytes() / blocks - (5 << 10);
    int64_t stages = std::clamp<int64_t>(room / bytes, 2, 4);
    loop->setAttr(attr::stages, builder.getI64IntegerAttr(stages));
    for (Operation *load : loads)
      setLayout(load, getLayout(load).withStages(stages));
  }

  /// A quarter of a thread's registers more would halve the threads that hide
  /// each other's waits.
  void limitRegisters(ArrayRef<TileMatmulOp> products) {
    constexpr int64_t registers = 128;
    int64_t sums = 0;
    for (TileMatmulOp op : products) {
      bool isDouble = tileType(op.getResult()).getElementType().isF64();
      sums = std::max(sums, getProductForm(op)->slots * (isDouble ? 2 : 1));
    }
    int64_t blocks = (64 << 10) / (registers * threads);
    if (sums > mostSharedSums / 2 && sums <= mostSharedSums && blocks > 1)
      kernel->setAttr(warp::attr::leastBlocks,
                      Builder(kernel.getContext()).getI64IntegerAttr(blocks));
  }

  /// Accumulators of a thread for an occupancy of two blocks.
  static constexpr int64_t mostSharedSums = 64;

  FunctionOpInterface kernel;
  TileBuffers buffers;
  /// Copies of tiles in memory that loops begin with.
  llvm::SetVector<Operation *> copies;
  int64_t threads;
  const TargetInfo &target;
};

} // namespace

void planAccumulators(FunctionOpInterface kernel, int64_t threads) {
  if (getTarget(kernel).isSimt() && threads > 1 && !getVariant(kernel).getDebug())
    AccumulatorPlanner(kernel, threads).run();
}

} // namespace warp::tiles
