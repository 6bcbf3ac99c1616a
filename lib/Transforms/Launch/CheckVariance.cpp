//===- CheckVariance.cpp - Run-time checks of divergence facts ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Puts tests behind the values of a kernel, for everything that ThreadVariance
// says of them: that threads have the same value, or one with a constant step;
// that it is a sum of thread indices and trips; its range; and that an index
// tells threads apart.
//
// A claim about one thread is compared where the value is. A claim
// about several threads goes through a table in memory: the first thread that
// gets to a claim (and element, or iteration) leaves its value there, and those
// that come later compare theirs. Threads may run at the same time: claim and
// value are one word, so that each thread sees both or neither.
//
// The table is an argument of the kernel, the array of 64-bit integers called
// `warp_claims`; a kernel without one stays as it is. Element 0 counts claims
// that did not hold, element 1 is the number of the last such claim, and from
// element 8 on there are 2^17 words, all zero at first: 40 bits of the claim's
// key above 24 bits of its value's hash. A word that is taken by another key is
// overwritten: a test is left out, none fails.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_CHECKVARIANCE
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::Agreement;
using warp::Form;
using warp::Scope;
using warp::Symbol;

constexpr llvm::StringLiteral recordName = "warp_claims";
constexpr int64_t firstWord = 8, wordBits = 17, valueBits = 24;
/// Threads that are lanes of one vector, or less.
constexpr int64_t lanes = 16;
/// An odd number with bits all over (of the golden ratio), which mixes keys.
constexpr int64_t mixer = 0x9E3779B97F4A7C15;

namespace {

class ClaimTests {
public:
  ClaimTests(FunctionOpInterface kernel, Value record)
      : kernel(kernel), variance(kernel), record(record),
        b(kernel->getContext()), loc(kernel.getLoc()) {}

  void run();

private:
  using Values = SmallVector<Value>;

  void prepare();
  void countTrips(Operation *loop);
  void test(Value value);
  void testAccess(warp::AccessOp access);
  void testAgreement(Value value);
  void testForm(Value value);
  void testInterval(Value value);
  Value compute(const Form &form);
  Value compute(Symbol symbol);

  Value toBits(Value value);
  Values groupOf();
  Values iterationOf(Operation *op);
  void requireSame(ValueRange key, Value bits);
  void require(Value holds);
  void reportFailure();

  Value constant(Type type, int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  }
  Value constant(int64_t value) { return constant(b.getI64Type(), value); }
  Value add(Value x, Value y) { return arith::AddIOp::create(b, loc, x, y); }
  Value mul(Value x, Value y) { return arith::MulIOp::create(b, loc, x, y); }
  Value shiftRight(Value x, int64_t count) {
    return arith::ShRUIOp::create(b, loc, x, constant(count));
  }
  Value compare(arith::CmpIPredicate predicate, Value x, Value y) {
    return arith::CmpIOp::create(b, loc, predicate, x, y);
  }
  Value load(Value index) {
    Type i64 = b.getI64Type();
    return warp::LoadComponentsOp::create(b, loc, TypeRange(i64), record, index)
        .getResult(0);
  }
  void store(Value value, Value index) {
    warp::StoreComponentsOp::create(b, loc, value, record, index);
  }

  FunctionOpInterface kernel;
  warp::ThreadVariance variance;
  Value record;
  OpBuilder b;
  Location loc;
  /// Indices of the thread, as many as the kernel asks for.
  Values indices;
  /// Memory of the thread with the finished iterations of each loop.
  DenseMap<Operation *, Value> trips;
  /// The place for tests of a block's arguments: behind the counting of trips.
  DenseMap<Block *, Operation *> starts;
  int64_t number = 0;
};

} // namespace

//===----------------------------------------------------------------------===//
// The table
//===----------------------------------------------------------------------===//

void ClaimTests::reportFailure() {
  Value count = constant(b.getI32Type(), 0), last = constant(b.getI32Type(), 1);
  store(add(load(count), constant(1)), count);
  store(constant(number), last);
}

void ClaimTests::require(Value holds) {
  ++number;
  Value fails =
      arith::XOrIOp::create(b, loc, holds, constant(b.getI1Type(), 1));
  auto branch = scf::IfOp::create(b, loc, fails, /*withElseRegion=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  reportFailure();
}

/// All threads that come here with this key must have the same bits.
void ClaimTests::requireSame(ValueRange key, Value bits) {
  Value mixed = mul(constant(++number), constant(mixer));
  for (Value part : key)
    mixed = mul(add(mixed, part), constant(mixer));
  Value at = add(shiftRight(mixed, 64 - wordBits), constant(firstWord));
  at = arith::TruncIOp::create(b, loc, b.getI32Type(), at);
  // The key's bits below those of the place; zero says that nobody was here.
  Value name = arith::ShLIOp::create(b, loc, mixed, constant(wordBits));
  name = arith::OrIOp::create(b, loc, name, constant(int64_t(1) << valueBits));
  name = arith::AndIOp::create(b, loc, name, constant(-1LL << valueBits));
  Value hash = shiftRight(mul(bits, constant(mixer)), 64 - valueBits);
  Value word = arith::OrIOp::create(b, loc, name, hash);
  Value found = load(at);
  Value difference = arith::XOrIOp::create(b, loc, found, word);
  Value isNew = compare(arith::CmpIPredicate::uge, difference,
                        constant(int64_t(1) << valueBits));
  auto first = scf::IfOp::create(b, loc, isNew, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(first.thenBlock());
  store(word, at);
  b.setInsertionPointToStart(first.elseBlock());
  Value differs =
      compare(arith::CmpIPredicate::ne, difference, constant(int64_t(0)));
  auto failed = scf::IfOp::create(b, loc, differs, /*withElseRegion=*/false);
  b.setInsertionPointToStart(failed.thenBlock());
  reportFailure();
}

/// A number or boolean as 64 bits; null for other values.
Value ClaimTests::toBits(Value value) {
  Type type = value.getType(), i64 = b.getI64Type();
  if (type.isF32() || type.isF64()) {
    type = b.getIntegerType(type.getIntOrFloatBitWidth());
    value = arith::BitcastOp::create(b, loc, type, value);
  }
  if (type.isInteger(1))
    return arith::ExtUIOp::create(b, loc, i64, value);
  if (type == i64 || !isa<IntegerType>(type))
    return type == i64 ? value : Value();
  return arith::ExtSIOp::create(b, loc, i64, value);
}

//===----------------------------------------------------------------------===//
// Threads and iterations
//===----------------------------------------------------------------------===//

/// The lanes that a thread is one of.
ClaimTests::Values ClaimTests::groupOf() {
  Values key;
  for (Value index : indices)
    key.push_back(toBits(index));
  key.back() = arith::DivUIOp::create(b, loc, key.back(), constant(lanes));
  return key;
}

ClaimTests::Values ClaimTests::iterationOf(Operation *op) {
  Values key;
  for (; op != kernel; op = op->getParentOp())
    if (Value trip = trips.lookup(op))
      key.push_back(toBits(warp::ScratchLoadOp::create(
          b, loc, b.getI32Type(), trip, constant(b.getI32Type(), 0))));
  return key;
}

/// Counts from -1 in front of the loop by one where an iteration begins.
void ClaimTests::countTrips(Operation *loop) {
  Type i32 = b.getI32Type();
  b.setInsertionPointToStart(&kernel.getFunctionBody().front());
  Value memory = warp::ScratchOp::create(
      b, loc, warp::ScratchType::get(b.getContext(), 1, i32));
  b.setInsertionPoint(loop);
  Value zero = constant(i32, 0);
  warp::ScratchStoreOp::create(b, loc, constant(i32, -1), memory, zero);
  b.setInsertionPointToStart(&loop->getRegion(0).front());
  Value before =
      warp::ScratchLoadOp::create(b, loc, i32, memory, constant(i32, 0));
  starts[&loop->getRegion(0).front()] = warp::ScratchStoreOp::create(
      b, loc, add(before, constant(i32, 1)), memory, constant(i32, 0));
  trips[loop] = memory;
}

void ClaimTests::prepare() {
  unsigned rank = 1;
  SmallVector<Operation *> loops;
  kernel->walk([&](Operation *op) {
    if (isa<warp::TidOp>(op))
      rank = std::max(rank, op->getNumResults());
    if (isa<scf::ForOp, scf::WhileOp>(op))
      loops.push_back(op);
  });
  for (Operation *loop : loops)
    countTrips(loop);
  b.setInsertionPointToStart(&kernel.getFunctionBody().front());
  SmallVector<Type> types(rank, b.getI32Type());
  indices = Values(warp::TidOp::create(b, loc, types).getResults());
}

//===----------------------------------------------------------------------===//
// Claims
//===----------------------------------------------------------------------===//

/// That threads agree, or have values with a constant step. A step is one
/// modulo 2^32: wider numbers may have wrapped before they were wider.
void ClaimTests::testAgreement(Value value) {
  Value bits = toBits(value);
  if (!bits)
    return;
  if (variance.isUniform(value, Scope::Launch))
    return requireSame({}, bits);
  Agreement agreement = variance.agreement(value, Scope::Lanes);
  std::optional<int64_t> step = variance.step(value);
  // Threads in step find other values of written elements than these, which run
  // one after the other.
  if (!step || variance.dependsOnWrites(value))
    return;
  Values key = groupOf();
  if (agreement != Agreement::Yes)
    llvm::append_range(key, iterationOf(value.getParentBlock()->getParentOp()));
  if (*step != 0) {
    Value steps = mul(toBits(indices.back()), constant(-*step));
    bits = arith::TruncIOp::create(b, loc, b.getI32Type(), add(bits, steps));
    bits = toBits(bits);
  }
  requireSame(key, bits);
}

Value ClaimTests::compute(Symbol symbol) {
  switch (symbol.kind) {
  case Symbol::Kind::Thread:
    return toBits(indices[symbol.number]);
  case Symbol::Kind::Trip: {
    Value memory = trips.lookup(symbol.getLoop());
    return toBits(warp::ScratchLoadOp::create(b, loc, b.getI32Type(), memory,
                                              constant(b.getI32Type(), 0)));
  }
  case Symbol::Kind::Extent:
    return toBits(warp::DimOp::create(b, loc, b.getI32Type(), symbol.getValue(),
                                      symbol.number));
  case Symbol::Kind::Opaque:
    return toBits(symbol.getValue());
  }
  llvm_unreachable("no such symbol");
}

Value ClaimTests::compute(const Form &form) {
  Value sum = constant(form.constant);
  for (const warp::Term &term : form.terms) {
    Value product = constant(term.factor);
    for (Symbol symbol : term.product)
      product = mul(product, compute(symbol));
    sum = add(sum, product);
  }
  return sum;
}

void ClaimTests::testForm(Value value) {
  const Form &form = variance.form(value);
  // The values that a while loop passes on are not visible in its second
  // region.
  auto isVisible = [&](Symbol symbol) {
    Value part = symbol.getValue();
    return !part || part.getParentRegion()->isAncestor(value.getParentRegion());
  };
  if (!form.isExact || form.getSymbol() == Symbol::opaque(value) ||
      !llvm::all_of(form.terms, [&](const warp::Term &term) {
        return llvm::all_of(term.product, isVisible);
      }))
    return;
  Value expected = compute(form);
  if (value.getType() != expected.getType())
    expected = arith::TruncIOp::create(b, loc, value.getType(), expected);
  require(compare(arith::CmpIPredicate::eq, value, expected));
}

void ClaimTests::testInterval(Value value) {
  warp::Interval interval = variance.range(value, value.getParentBlock());
  Value bits = toBits(value);
  if (interval.low > INT64_MIN)
    require(compare(arith::CmpIPredicate::sge, bits,
                    constant(int64_t(interval.low))));
  if (interval.high < INT64_MAX)
    require(compare(arith::CmpIPredicate::sle, bits,
                    constant(int64_t(interval.high))));
}

void ClaimTests::test(Value value) {
  testAgreement(value);
  auto type = dyn_cast<IntegerType>(value.getType());
  if (!type || (type.getWidth() != 32 && type.getWidth() != 64))
    return;
  testForm(value);
  testInterval(value);
}

/// That indices are not negative, and belong to one thread.
void ClaimTests::testAccess(warp::AccessOp access) {
  b.setInsertionPoint(access);
  for (Value index : access.getIndices()) {
    Value bits = toBits(index);
    if (variance.isNonNegative(index, access->getBlock()))
      require(compare(arith::CmpIPredicate::sge, bits, constant(0)));
    const Form *form = &variance.form(index);
    for (auto [dim, thread] : llvm::enumerate(indices))
      if (variance.tellThreadsApart(form, dim, /*mayWrap=*/true))
        requireSame({bits}, toBits(thread));
  }
}

void ClaimTests::run() {
  SmallVector<Value> values;
  SmallVector<warp::AccessOp> accesses;
  kernel->walk<WalkOrder::PreOrder>([&](Operation *op) {
    if (!op->hasTrait<OpTrait::ConstantLike>())
      llvm::append_range(values, op->getResults());
    for (Region &region : op->getRegions())
      for (Block &block : region)
        llvm::append_range(values, block.getArguments());
    if (auto access = dyn_cast<warp::AccessOp>(op))
      accesses.push_back(access);
  });
  prepare();
  for (Value value : values) {
    Block *block = value.getParentBlock();
    if (value.getDefiningOp())
      b.setInsertionPointAfterValue(value);
    else if (Operation *counting = starts.lookup(block))
      b.setInsertionPointAfter(counting);
    else if (block == indices.front().getParentBlock())
      b.setInsertionPointAfterValue(indices.front());
    else
      b.setInsertionPointToStart(block);
    test(value);
  }
  for (warp::AccessOp access : accesses)
    testAccess(access);
}

namespace {

struct CheckVariance : warp::impl::CheckVarianceBase<CheckVariance> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    auto names = kernel->getAttrOfType<ArrayAttr>(warp::attr::argNames);
    bool isTested = !kernel->hasAttr(warp::attr::variant) ||
                    warp::getVariant(kernel).getDebug();
    if (!names || !isTested)
      return;
    for (auto [name, argument] :
         llvm::zip(names.getAsRange<StringAttr>(), kernel.getArguments()))
      if (auto type = dyn_cast<warp::ArrayType>(argument.getType());
          name == recordName && type && type.getRank() == 1 &&
          type.getElementType().isSignedInteger(64))
        return ClaimTests(kernel, argument).run();
  }
};

} // namespace
