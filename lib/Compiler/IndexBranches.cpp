//===- IndexBranches.cpp - Branches for indices below zero ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An index that may count from the end has the extent added where it is below
// zero. That is a select while LLVM makes vectors and moves code, but scalar
// code waits for it, and it takes three instructions or four:
//
//     at = index + (index < 0 ? extent : 0)       if index < 0:  index +=
//     extent load x[at]                             =>   load x[index]
//
// Hardly any index of a program is negative, so a processor predicts the branch
// and loads at once. Only extents that come from the launch's parameters are
// taken: where a program adds others to negative numbers of its own, signs may
// be random.
//
//===----------------------------------------------------------------------===//

#include "Target.h"

#include "llvm/IR/InstIterator.h"
#include "llvm/IR/Instructions.h"
#include "llvm/IR/MDBuilder.h"
#include "llvm/IR/Module.h"
#include "llvm/IR/PatternMatch.h"
#include "llvm/IR/ValueHandle.h"
#include "llvm/Transforms/Utils/BasicBlockUtils.h"
#include "llvm/Transforms/Utils/Local.h"

using namespace llvm::PatternMatch;

/// Branches that a function gets, at most: each is two blocks more to generate
/// code for.
static constexpr size_t mostBranches = 128;

namespace {
/// `sum` is the index, or the index and the extent where the test holds.
struct WrappedIndex {
  llvm::Instruction *sum;
  llvm::ICmpInst *test;
  bool isInverted;
  llvm::Value *index, *extent;
};
} // namespace

/// True if a number is a part of the launch's parameters, as extents are.
static bool isParameter(llvm::Value *value) {
  while (auto *cast = llvm::dyn_cast<llvm::CastInst>(value))
    value = cast->getOperand(0);
  auto *load = llvm::dyn_cast<llvm::LoadInst>(value);
  return load && llvm::isa<llvm::Argument>(
                     load->getPointerOperand()->stripInBoundsConstantOffsets());
}

/// True if a test compares a number with a bound of zero or less. The index may
/// be the number and a constant that is added to it, so the bound is not always
/// zero.
static bool tellsSign(llvm::ICmpInst *test) {
  const llvm::APInt *bound;
  if (!test || !match(test->getOperand(1), m_APInt(bound)))
    return false;
  return test->getPredicate() == llvm::ICmpInst::ICMP_SLT
             ? bound->sle(0)
             : test->getPredicate() == llvm::ICmpInst::ICMP_SGT &&
                   bound->slt(0);
}

static std::optional<WrappedIndex> wrappedIndex(llvm::SelectInst &select) {
  auto *test = llvm::dyn_cast<llvm::ICmpInst>(select.getCondition());
  if (!select.getType()->isIntegerTy() || !tellsSign(test))
    return std::nullopt;
  bool isInverted = test->getPredicate() == llvm::ICmpInst::ICMP_SGT;
  llvm::Value *negative = select.getTrueValue(),
              *other = select.getFalseValue(), *extent, *index;
  if (isInverted)
    std::swap(negative, other);
  if (match(negative, m_c_Add(m_Specific(other), m_Value(extent))) &&
      isParameter(extent))
    return WrappedIndex{&select, test, isInverted, other, extent};
  if (!match(other, m_Zero()) || !isParameter(negative) || !select.hasOneUse())
    return std::nullopt;
  auto *sum = llvm::cast<llvm::Instruction>(*select.user_begin());
  if (!match(sum, m_c_Add(m_Specific(&select), m_Value(index))))
    return std::nullopt;
  return WrappedIndex{sum, test, isInverted, index, negative};
}

static void branchOn(const WrappedIndex &found) {
  llvm::Instruction *sum = found.sum, *test = found.test;
  if (found.isInverted) {
    test = test->clone();
    llvm::cast<llvm::ICmpInst>(test)->setPredicate(
        found.test->getInversePredicate());
    test->insertBefore(sum->getIterator());
  }
  llvm::MDNode *weights =
      llvm::MDBuilder(sum->getContext()).createUnlikelyBranchWeights();
  llvm::BasicBlock *usual = sum->getParent();
  llvm::Instruction *rare = llvm::SplitBlockAndInsertIfThen(
      test, sum->getIterator(), /*Unreachable=*/false, weights);
  auto *fromEnd = llvm::BinaryOperator::CreateAdd(found.index, found.extent, "",
                                                  rare->getIterator());
  auto *at =
      llvm::PHINode::Create(sum->getType(), 2, "", sum->getParent()->begin());
  at->addIncoming(fromEnd, rare->getParent());
  at->addIncoming(found.index, usual);
  sum->replaceAllUsesWith(at);
  llvm::RecursivelyDeleteTriviallyDeadInstructions(sum);
}

static void branchIn(llvm::Function &function) {
  llvm::SmallVector<llvm::WeakVH> selects;
  for (llvm::Instruction &one : llvm::instructions(function))
    if (auto *select = llvm::dyn_cast<llvm::SelectInst>(&one))
      if (wrappedIndex(*select))
        selects.push_back(select);
  if (selects.size() > mostBranches)
    return;
  for (llvm::WeakVH &handle : selects)
    if (auto *select = llvm::dyn_cast_or_null<llvm::SelectInst>(handle))
      if (std::optional<WrappedIndex> found = wrappedIndex(*select))
        branchOn(*found);
}

void warp::branchOnIndices(llvm::Module &module) {
  for (llvm::Function &function : module)
    if (!function.isDeclaration())
      branchIn(function);
}
