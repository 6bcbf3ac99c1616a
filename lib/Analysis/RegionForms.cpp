//===- RegionForms.cpp - Affine forms of indices in access regions --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An index is followed up to thread indices, counters of loops and integers
// that all threads agree on. Values made of the latter alone become nodes of
// the formula, with the operation's own arithmetic; sums and multiples of the
// others become symbols, under the assumption that no index wraps. A choice
// (a branch, a minimum) is followed both ways.
//
//===----------------------------------------------------------------------===//

#include "RegionBuilder.h"

#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;
using warp::IndexForm;
using warp::IndexForms;
using warp::RegionBuilder;

using Kind = warp::RegionFormula::Op;
using Maybe = std::optional<IndexForm>;
using Node = warp::RegionFormula::Node;

/// Operations of a formula; a larger one would cost too much at each launch.
static constexpr size_t mostNodes = 256;

//===----------------------------------------------------------------------===//
// Nodes
//===----------------------------------------------------------------------===//

int32_t RegionBuilder::node(Kind op, int64_t a, int64_t b, Type type) {
  Node made{op, 64, true, a, b};
  if (auto integer = dyn_cast_or_null<IntegerType>(type)) {
    made.bits = integer.getWidth();
    made.isSigned = !integer.isUnsigned();
  }
  auto number = llvm::find(formula.nodes, made) - formula.nodes.begin();
  if (number == std::ssize(formula.nodes))
    formula.nodes.push_back(made);
  return static_cast<int32_t>(number);
}

std::optional<int64_t> RegionBuilder::constantOf(int32_t node) const {
  const Node &known = formula.nodes[node];
  return known.op == Kind::Constant ? std::optional(known.a) : std::nullopt;
}

/// Sums with zero, products with one, and what is made of constants alone need
/// no node.
int32_t RegionBuilder::combine(Kind op, int32_t a, int32_t b, Type type) {
  std::optional<int64_t> first = constantOf(a), second = constantOf(b);
  if (first && second && !type && op == Kind::Sub)
    return constant(*first - *second);
  if (first && second && !type && op == Kind::Add)
    return constant(*first + *second);
  if ((op == Kind::Add || op == Kind::Sub) && constantOf(b) == 0)
    return a;
  if (op == Kind::Add && constantOf(a) == 0)
    return b;
  if (op == Kind::Mul && (first == 0 || second == 0))
    return constant(0);
  if (op == Kind::Mul && constantOf(b) == 1)
    return a;
  if (op == Kind::Mul && constantOf(a) == 1)
    return b;
  return node(op, a, b, type);
}

//===----------------------------------------------------------------------===//
// IndexForms
//===----------------------------------------------------------------------===//

IndexForm RegionBuilder::sum(const IndexForm &a, const IndexForm &b,
                             bool negate) {
  IndexForm result = a;
  Kind op = negate ? Kind::Sub : Kind::Add;
  result.base = combine(op, a.base, b.base);
  for (IndexForm::Symbol symbol : b.symbols) {
    auto *same = llvm::find_if(result.symbols, [&](const auto &other) {
      return other.key == symbol.key;
    });
    if (same == result.symbols.end()) {
      if (negate)
        symbol.factor = node(Kind::Sub, constant(0), symbol.factor);
      result.symbols.push_back(symbol);
      continue;
    }
    same->factor = same->factor == symbol.factor && negate
                       ? constant(0)
                       : combine(op, same->factor, symbol.factor);
    if (constantOf(same->factor) == 0)
      result.symbols.erase(same);
  }
  return result;
}

IndexForm RegionBuilder::scaled(const IndexForm &form, int32_t factor,
                                Type type) {
  IndexForm result = form;
  // Without symbols this is the kernel's own arithmetic, which may wrap.
  result.base = combine(Kind::Mul, form.base, factor,
                        form.symbols.empty() ? type : Type());
  for (IndexForm::Symbol &symbol : result.symbols)
    symbol.factor = combine(Kind::Mul, symbol.factor, factor);
  return result;
}

IndexForms RegionBuilder::any(ArrayRef<Value> values) {
  IndexForms all;
  for (Value value : values) {
    const IndexForms &forms = formsOf(value);
    if (forms.empty() || all.size() + forms.size() > IndexForm::most)
      return {};
    all.append(forms);
  }
  return all;
}

IndexForms RegionBuilder::pairs(Operation *op, Join join) {
  // Copies: asking for the second may move the first.
  IndexForms first = formsOf(op->getOperand(0));
  IndexForms second = formsOf(op->getOperand(1));
  IndexForms all;
  if (first.size() * second.size() > IndexForm::most)
    return {};
  for (const IndexForm &a : first)
    for (const IndexForm &b : second) {
      std::optional<IndexForm> form = join(a, b);
      if (!form)
        return {};
      all.push_back(*form);
    }
  return all;
}

IndexForms RegionBuilder::ofUniform(Kind op, Operation *operation) {
  return pairs(operation, [&](const IndexForm &a, const IndexForm &b) -> Maybe {
    if (!a.symbols.empty() || !b.symbols.empty())
      return std::nullopt;
    Type type = operation->getResult(0).getType();
    return IndexForm{node(op, a.base, b.base, type), {}};
  });
}

//===----------------------------------------------------------------------===//
// Values
//===----------------------------------------------------------------------===//

const IndexForms &RegionBuilder::formsOf(Value value) {
  std::unique_ptr<IndexForms> &found = known[value];
  if (!found) {
    // A value that depends on itself is unknown.
    found = std::make_unique<IndexForms>();
    IndexForms forms;
    if (isa<IntegerType, IndexType>(value.getType()) &&
        formula.nodes.size() < mostNodes)
      forms = compute(value);
    known[value] = std::make_unique<IndexForms>(std::move(forms));
  }
  return *known[value];
}

IndexForms RegionBuilder::ofArgument(BlockArgument argument) {
  auto type = dyn_cast<IntegerType>(argument.getType());
  if (!type || type.getWidth() < 8)
    return {};
  int64_t offset = layout.offsets[argument.getArgNumber()];
  return {IndexForm{node(Kind::Argument, offset, 0, type), {}}};
}

/// A field of a struct that is an argument.
IndexForms RegionBuilder::ofField(warp::StructGetOp get) {
  auto type = dyn_cast<IntegerType>(get.getType());
  int64_t offset = 0;
  Value source = get;
  while (auto field = source.getDefiningOp<warp::StructGetOp>()) {
    source = field.getSource();
    auto structure = cast<warp::StructType>(source.getType());
    offset += warp::getFieldOffset(structure,
                                   structure.getFieldIndex(field.getField()));
  }
  auto argument = dyn_cast<BlockArgument>(source);
  if (!type || type.getWidth() < 8 || !argument ||
      argument.getOwner() != &kernel.getBody().front())
    return {};
  offset += layout.offsets[argument.getArgNumber()];
  return {IndexForm{node(Kind::Argument, offset, 0, type), {}}};
}

IndexForms RegionBuilder::ofExtent(warp::DimOp dim) {
  Value array = dim.getArray();
  int64_t number = dim.getDim();
  while (auto view = array.getDefiningOp<warp::ArrayViewOp>()) {
    if (isa<warp::SliceOp>(view))
      return {};
    if (auto part = dyn_cast<warp::ViewOp>(view.getOperation()))
      number += part.getIndices().size();
    array = view.getArray();
  }
  SmallVector<unsigned, 1> leaf = origins.getLeaves().of(array);
  if (leaf.size() != 1)
    return {};
  int64_t offset = offsets[leaf.front()];
  return {IndexForm{node(Kind::ArrayExtent, offset, number), {}}};
}

IndexForms RegionBuilder::ofCounter(scf::ForOp loop) {
  IndexForms lower = formsOf(loop.getLowerBound());
  IndexForms upper = formsOf(loop.getUpperBound());
  IndexForms step = formsOf(loop.getStep());
  if (lower.size() != 1 || upper.size() != 1 || step.size() != 1 ||
      !step.front().symbols.empty())
    return {};
  // Threads may begin elsewhere if all make the same number of trips.
  IndexForm length = sum(upper.front(), lower.front(), /*negate=*/true);
  if (!length.symbols.empty())
    return {};
  int32_t stride = step.front().base;
  int32_t up =
      combine(Kind::Add, length.base, combine(Kind::Sub, stride, constant(1)));
  int32_t count =
      constantOf(stride) == 1 ? up : node(Kind::FloorDiv, up, stride);
  IndexForm form = lower.front();
  form.symbols.push_back({loop.getOperation(), stride, count});
  return {form};
}

IndexForms RegionBuilder::ofNegation(Operation *op) {
  IndexForms forms;
  for (const IndexForm &form : IndexForms(formsOf(op->getOperand(0))))
    forms.push_back(scaled(form, constant(-1), op->getResult(0).getType()));
  return forms;
}

IndexForms RegionBuilder::ofThread(unsigned dim) {
  const void *key = reinterpret_cast<const void *>(uintptr_t(dim + 1));
  int32_t count = node(Kind::Extent, dim);
  return {IndexForm{constant(0), {{key, constant(1), count}}}};
}

IndexForms RegionBuilder::ofCast(warp::CastOp cast) {
  Type type = cast.getType();
  if (!isa<IntegerType, IndexType>(cast.getSource().getType()))
    return {};
  bool mayWrap = isa<IntegerType>(type) && type.getIntOrFloatBitWidth() < 32;
  IndexForms forms = formsOf(cast.getSource());
  for (IndexForm &form : forms) {
    if (form.symbols.empty() && (mayWrap || !constantOf(form.base)))
      form.base = node(Kind::Cast, form.base, 0, type);
    if (!form.symbols.empty() && mayWrap)
      return {};
  }
  return forms;
}

IndexForms RegionBuilder::ofSum(Operation *op, bool negate) {
  return pairs(op, [&](const IndexForm &a, const IndexForm &b) -> Maybe {
    if (!a.symbols.empty() || !b.symbols.empty())
      return sum(a, b, negate);
    return IndexForm{combine(negate ? Kind::Sub : Kind::Add, a.base, b.base,
                             op->getResult(0).getType()),
                     {}};
  });
}

IndexForms RegionBuilder::ofProduct(Operation *op) {
  Type type = op->getResult(0).getType();
  return pairs(op, [&](const IndexForm &a, const IndexForm &b) -> Maybe {
    if (b.symbols.empty())
      return scaled(a, b.base, type);
    if (a.symbols.empty())
      return scaled(b, a.base, type);
    return std::nullopt;
  });
}

/// A minimum or maximum: what all threads agree on, or one of both.
IndexForms RegionBuilder::ofExtremum(Kind kind, Operation *op) {
  IndexForms forms = ofUniform(kind, op);
  return forms.empty() ? any({op->getOperand(0), op->getOperand(1)}) : forms;
}

IndexForms RegionBuilder::compute(Value value) {
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Operation *owner = argument.getOwner()->getParentOp();
    if (owner == kernel)
      return ofArgument(argument);
    auto loop = dyn_cast<scf::ForOp>(owner);
    return loop && argument == loop.getInductionVar() ? ofCounter(loop)
                                                      : IndexForms();
  }
  IntegerAttr attr;
  if (matchPattern(value, m_Constant(&attr)))
    return {IndexForm{constant(attr.getType().isUnsignedInteger()
                                   ? int64_t(attr.getValue().getZExtValue())
                                   : attr.getValue().getSExtValue()),
                      {}}};
  return ofResult(cast<OpResult>(value));
}

IndexForms RegionBuilder::ofResult(OpResult value) {
  Operation *op = value.getOwner();
  unsigned number = value.getResultNumber();
  return llvm::TypeSwitch<Operation *, IndexForms>(op)
      .Case([&](warp::TidOp) { return ofThread(number); })
      .Case([&](warp::CastOp cast) { return ofCast(cast); })
      .Case([&](warp::StructGetOp get) { return ofField(get); })
      .Case([&](warp::DimOp dim) { return ofExtent(dim); })
      .Case([&](warp::AddOp) { return ofSum(op, /*negate=*/false); })
      .Case([&](warp::SubOp) { return ofSum(op, /*negate=*/true); })
      .Case([&](warp::NegOp) { return ofNegation(op); })
      .Case([&](warp::MulOp) { return ofProduct(op); })
      .Case([&](warp::DivOp) { return ofUniform(Kind::Div, op); })
      .Case([&](warp::FloorDivOp) { return ofUniform(Kind::FloorDiv, op); })
      .Case([&](warp::ModOp) { return ofUniform(Kind::Mod, op); })
      .Case([&](warp::BitAndOp) { return ofUniform(Kind::And, op); })
      .Case([&](warp::BitOrOp) { return ofUniform(Kind::Or, op); })
      .Case([&](warp::BitXorOp) { return ofUniform(Kind::Xor, op); })
      .Case([&](warp::LShiftOp) { return ofUniform(Kind::ShiftLeft, op); })
      .Case([&](warp::RShiftOp) { return ofUniform(Kind::ShiftRight, op); })
      .Case([&](warp::MinOp) { return ofExtremum(Kind::Min, op); })
      .Case([&](warp::MaxOp) { return ofExtremum(Kind::Max, op); })
      .Case([&](warp::ClampOp) {
        return any({op->getOperand(0), op->getOperand(1), op->getOperand(2)});
      })
      .Case<warp::WhereOp, arith::SelectOp>([&](Operation *) {
        return any({op->getOperand(1), op->getOperand(2)});
      })
      .Case([&](scf::IfOp branch) {
        return any({branch.thenYield().getOperand(number),
                    branch.elseYield().getOperand(number)});
      })
      .Default([](Operation *) { return IndexForms(); });
}
