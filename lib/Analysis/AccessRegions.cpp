//===- AccessRegions.cpp - What a kernel touches of its arrays ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An index is followed up to thread indices, counters of loops and integers
// that all threads agree on. What is made of the latter alone becomes nodes of
// the formula, with the operation's own arithmetic; sums and multiples of the
// others become symbols, under the assumption that no index wraps. A choice
// (a branch, a minimum) is followed both ways.
//
//===----------------------------------------------------------------------===//

#include "Analysis/AccessRegions.h"

#include "Analysis/ArrayOrigins.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpOps.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;

using Kind = warp::RegionFormula::Op;
using Node = warp::RegionFormula::Node;

/// Forms that one index may have; more are any index.
static constexpr size_t mostForms = 4;
/// Operations of a formula; a larger one would cost too much at each launch.
static constexpr size_t mostNodes = 256;

namespace {

/// A node plus multiples of symbols.
struct Form {
  /// `factor` times 0, 1, ... below `count`, nodes both. Symbols are the same
  /// if their keys are: a thread dimension, or the counter of a loop.
  struct Symbol {
    const void *key;
    int32_t factor, count;
  };
  int32_t base = 0;
  SmallVector<Symbol, 2> symbols;
};

/// What an index may be; anything if there are none.
using Forms = SmallVector<Form, 1>;

class RegionBuilder {
public:
  explicit RegionBuilder(func::FuncOp kernel);
  warp::RegionFormula run();

private:
  // Nodes.
  int32_t node(Kind op, int64_t a, int64_t b = 0, Type type = {});
  int32_t constant(int64_t value) { return node(Kind::Constant, value); }
  std::optional<int64_t> constantOf(int32_t node) const;
  int32_t combine(Kind op, int32_t a, int32_t b, Type type = {});

  // Values.
  const Forms &formsOf(Value value);
  Forms compute(Value value);
  Forms ofResult(OpResult value);
  Forms ofThread(unsigned dim);
  Forms ofCast(warp::CastOp cast);
  Forms ofSum(Operation *op, bool negate);
  Forms ofNegation(Operation *op);
  Forms ofProduct(Operation *op);
  Forms ofExtremum(Kind kind, Operation *op);
  Forms ofArgument(BlockArgument argument);
  Forms ofField(warp::StructGetOp get);
  Forms ofExtent(warp::DimOp dim);
  Forms ofCounter(scf::ForOp loop);
  Forms ofUniform(Kind op, Operation *operation);
  Forms pairs(Operation *op, llvm::function_ref<std::optional<Form>(
                                 const Form &, const Form &)>
                                 join);
  Forms any(ArrayRef<Value> values);
  Form sum(const Form &a, const Form &b, bool negate);
  Form scaled(const Form &form, int32_t factor, Type type);

  // Accesses.
  void visit(Operation *op);
  void add(warp::AccessOp op);
  void markUnknown(Value array);
  bool collectIndices(Value array, SmallVectorImpl<const Forms *> &indices,
                      Value &root);
  void addChoices(warp::RegionFormula::Access access,
                  ArrayRef<const Forms *> indices);

  func::FuncOp kernel;
  warp::ArrayOrigins origins;
  warp::ParameterLayout layout;
  SmallVector<int64_t> offsets;
  warp::RegionFormula formula;
  llvm::DenseMap<Value, std::unique_ptr<Forms>> known;
  const Forms unknown;
};

} // namespace

RegionBuilder::RegionBuilder(func::FuncOp kernel)
    : kernel(kernel), origins(kernel),
      layout(warp::layOutParameters(kernel.getArgumentTypes())) {
  for (auto [type, offset] :
       llvm::zip_equal(kernel.getArgumentTypes(), layout.offsets)) {
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(type, offset, leaves);
    for (warp::Leaf leaf : leaves)
      if (isa<warp::ArrayType>(leaf.type))
        offsets.push_back(leaf.offset);
  }
  formula.unknown.assign(origins.getLeaves().size(), false);
}

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
// Forms
//===----------------------------------------------------------------------===//

Form RegionBuilder::sum(const Form &a, const Form &b, bool negate) {
  Form result = a;
  Kind op = negate ? Kind::Sub : Kind::Add;
  result.base = combine(op, a.base, b.base);
  for (Form::Symbol symbol : b.symbols) {
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

Form RegionBuilder::scaled(const Form &form, int32_t factor, Type type) {
  Form result = form;
  // Without symbols this is the kernel's own arithmetic, which may wrap.
  result.base = combine(Kind::Mul, form.base, factor,
                        form.symbols.empty() ? type : Type());
  for (Form::Symbol &symbol : result.symbols)
    symbol.factor = combine(Kind::Mul, symbol.factor, factor);
  return result;
}

Forms RegionBuilder::any(ArrayRef<Value> values) {
  Forms all;
  for (Value value : values) {
    const Forms &forms = formsOf(value);
    if (forms.empty() || all.size() + forms.size() > mostForms)
      return {};
    all.append(forms);
  }
  return all;
}

Forms RegionBuilder::pairs(
    Operation *op,
    llvm::function_ref<std::optional<Form>(const Form &, const Form &)> join) {
  // Copies: asking for the second may move the first.
  Forms first = formsOf(op->getOperand(0)), second = formsOf(op->getOperand(1));
  Forms all;
  if (first.size() * second.size() > mostForms)
    return {};
  for (const Form &a : first)
    for (const Form &b : second) {
      std::optional<Form> form = join(a, b);
      if (!form)
        return {};
      all.push_back(*form);
    }
  return all;
}

Forms RegionBuilder::ofUniform(Kind op, Operation *operation) {
  return pairs(operation,
               [&](const Form &a, const Form &b) -> std::optional<Form> {
                 if (!a.symbols.empty() || !b.symbols.empty())
                   return std::nullopt;
                 Type type = operation->getResult(0).getType();
                 return Form{node(op, a.base, b.base, type), {}};
               });
}

//===----------------------------------------------------------------------===//
// Values
//===----------------------------------------------------------------------===//

const Forms &RegionBuilder::formsOf(Value value) {
  std::unique_ptr<Forms> &found = known[value];
  if (!found) {
    // What depends on itself is not known.
    found = std::make_unique<Forms>();
    Forms forms;
    if (isa<IntegerType, IndexType>(value.getType()) &&
        formula.nodes.size() < mostNodes)
      forms = compute(value);
    known[value] = std::make_unique<Forms>(std::move(forms));
  }
  return *known[value];
}

Forms RegionBuilder::ofArgument(BlockArgument argument) {
  auto type = dyn_cast<IntegerType>(argument.getType());
  if (!type || type.getWidth() < 8)
    return {};
  int64_t offset = layout.offsets[argument.getArgNumber()];
  return {Form{node(Kind::Argument, offset, 0, type), {}}};
}

/// A field of a struct that is an argument.
Forms RegionBuilder::ofField(warp::StructGetOp get) {
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
  return {Form{node(Kind::Argument, offset, 0, type), {}}};
}

Forms RegionBuilder::ofExtent(warp::DimOp dim) {
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
  return {Form{node(Kind::ArrayExtent, offsets[leaf.front()], number), {}}};
}

Forms RegionBuilder::ofCounter(scf::ForOp loop) {
  Forms lower = formsOf(loop.getLowerBound());
  Forms upper = formsOf(loop.getUpperBound());
  Forms step = formsOf(loop.getStep());
  if (lower.size() != 1 || upper.size() != 1 || step.size() != 1 ||
      !step.front().symbols.empty())
    return {};
  // Threads may begin elsewhere if all make the same number of trips.
  Form length = sum(upper.front(), lower.front(), /*negate=*/true);
  if (!length.symbols.empty())
    return {};
  int32_t stride = step.front().base;
  int32_t up = combine(Kind::Add, length.base,
                       combine(Kind::Sub, stride, constant(1)));
  int32_t count =
      constantOf(stride) == 1 ? up : node(Kind::FloorDiv, up, stride);
  Form form = lower.front();
  form.symbols.push_back({loop.getOperation(), stride, count});
  return {form};
}

Forms RegionBuilder::ofNegation(Operation *op) {
  Forms forms;
  for (const Form &form : Forms(formsOf(op->getOperand(0))))
    forms.push_back(scaled(form, constant(-1), op->getResult(0).getType()));
  return forms;
}

Forms RegionBuilder::ofThread(unsigned dim) {
  const void *key = reinterpret_cast<const void *>(uintptr_t(dim + 1));
  return {Form{constant(0), {{key, constant(1), node(Kind::Extent, dim)}}}};
}

Forms RegionBuilder::ofCast(warp::CastOp cast) {
  Type type = cast.getType();
  if (!isa<IntegerType, IndexType>(cast.getSource().getType()))
    return {};
  bool mayWrap = isa<IntegerType>(type) && type.getIntOrFloatBitWidth() < 32;
  Forms forms = formsOf(cast.getSource());
  for (Form &form : forms) {
    if (form.symbols.empty() && (mayWrap || !constantOf(form.base)))
      form.base = node(Kind::Cast, form.base, 0, type);
    if (!form.symbols.empty() && mayWrap)
      return {};
  }
  return forms;
}

Forms RegionBuilder::ofSum(Operation *op, bool negate) {
  return pairs(op, [&](const Form &a, const Form &b) -> std::optional<Form> {
    if (!a.symbols.empty() || !b.symbols.empty())
      return sum(a, b, negate);
    return Form{combine(negate ? Kind::Sub : Kind::Add, a.base, b.base,
                        op->getResult(0).getType()),
                {}};
  });
}

Forms RegionBuilder::ofProduct(Operation *op) {
  Type type = op->getResult(0).getType();
  return pairs(op, [&](const Form &a, const Form &b) -> std::optional<Form> {
    if (b.symbols.empty())
      return scaled(a, b.base, type);
    if (a.symbols.empty())
      return scaled(b, a.base, type);
    return std::nullopt;
  });
}

/// A minimum or maximum: what all threads agree on, or one of both.
Forms RegionBuilder::ofExtremum(Kind kind, Operation *op) {
  Forms forms = ofUniform(kind, op);
  return forms.empty() ? any({op->getOperand(0), op->getOperand(1)}) : forms;
}

Forms RegionBuilder::compute(Value value) {
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Operation *owner = argument.getOwner()->getParentOp();
    if (owner == kernel)
      return ofArgument(argument);
    auto loop = dyn_cast<scf::ForOp>(owner);
    return loop && argument == loop.getInductionVar() ? ofCounter(loop)
                                                      : Forms();
  }
  IntegerAttr attr;
  if (matchPattern(value, m_Constant(&attr)))
    return {Form{constant(attr.getType().isUnsignedInteger()
                              ? int64_t(attr.getValue().getZExtValue())
                              : attr.getValue().getSExtValue()),
                 {}}};
  return ofResult(cast<OpResult>(value));
}

Forms RegionBuilder::ofResult(OpResult value) {
  Operation *op = value.getOwner();
  unsigned number = value.getResultNumber();
  return llvm::TypeSwitch<Operation *, Forms>(op)
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
      .Default([](Operation *) { return Forms(); });
}

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

/// The forms of an access's indices along the dimensions of the array that its
/// views were taken of; false if a view has another origin.
bool RegionBuilder::collectIndices(Value array,
                                   SmallVectorImpl<const Forms *> &indices,
                                   Value &root) {
  while (auto view = array.getDefiningOp<warp::ArrayViewOp>()) {
    if (auto part = dyn_cast<warp::ViewOp>(view.getOperation())) {
      SmallVector<const Forms *> leading;
      for (Value index : part.getIndices())
        leading.push_back(&formsOf(index));
      indices.insert(indices.begin(), leading.begin(), leading.end());
    } else if (auto slice = dyn_cast<warp::SliceOp>(view.getOperation())) {
      if (slice.getDim() < indices.size())
        indices[slice.getDim()] = &unknown;
    } else if (!isa<warp::ComponentViewOp>(view)) {
      return false;
    }
    array = view.getArray();
  }
  root = array;
  return true;
}

void RegionBuilder::markUnknown(Value array) {
  warp::ArrayOrigin origin = origins.of(array);
  for (warp::ArrayMemory memory : origin.memories)
    if (!memory.isGradient && memory.leaf < int64_t(formula.unknown.size()))
      formula.unknown[memory.leaf] = true;
  if (!origin.isComplete)
    formula.unknown.assign(formula.unknown.size(), true);
}

void RegionBuilder::addChoices(warp::RegionFormula::Access access,
                               ArrayRef<const Forms *> indices) {
  size_t choices = 1;
  for (const Forms *forms : indices)
    choices *= std::max<size_t>(forms->size(), 1);
  // Too many: any index where there is a choice.
  bool isSimple = choices <= mostForms;
  for (size_t number = 0; number < (isSimple ? choices : 1); ++number) {
    access.indices.clear();
    size_t rest = number;
    for (const Forms *forms : indices) {
      warp::RegionFormula::Index index;
      if (forms->size() == 1 || (isSimple && !forms->empty())) {
        const Form &form = (*forms)[rest % forms->size()];
        rest /= forms->size();
        index.base = form.base;
        for (const Form::Symbol &symbol : form.symbols)
          index.symbols.push_back({symbol.factor, symbol.count});
      }
      access.indices.push_back(index);
    }
    formula.accesses.push_back(access);
  }
}

void RegionBuilder::add(warp::AccessOp op) {
  SmallVector<const Forms *> indices;
  for (Value index : op.getIndices())
    indices.push_back(&formsOf(index));
  Value root;
  SmallVector<unsigned, 1> leaf;
  if (collectIndices(op.getArray(), indices, root))
    leaf = origins.getLeaves().of(root);
  if (leaf.size() != 1)
    return markUnknown(op.getArray());
  warp::RegionFormula::Access access;
  access.array = static_cast<int32_t>(leaf.front());
  access.reads = !op.mayWrite() || (op.isUpdate() && !op->use_empty());
  access.writes = op.mayWrite();
  addChoices(access, indices);
}

void RegionBuilder::visit(Operation *op) {
  if (auto access = dyn_cast<warp::AccessOp>(op)) {
    if (access->getParentOfType<func::FuncOp>() == kernel)
      add(access);
    else
      markUnknown(access.getArray());
    return;
  }
  // What is handed on is followed to where it is accessed.
  if (isa<warp::ArrayViewOp, warp::DimOp, warp::GradOp, func::CallOp,
          func::ReturnOp, RegionBranchOpInterface,
          RegionBranchTerminatorOpInterface, warp::StructCreateOp,
          warp::StructSetOp, warp::StructGetOp>(op))
    return;
  for (Value operand : op->getOperands())
    if (isa<warp::ArrayType>(operand.getType()))
      markUnknown(operand);
}

warp::RegionFormula RegionBuilder::run() {
  kernel->getParentOfType<ModuleOp>().walk([&](Operation *op) { visit(op); });
  return std::move(formula);
}

warp::RegionFormula warp::findAccessRegions(func::FuncOp kernel) {
  return RegionBuilder(kernel).run();
}
