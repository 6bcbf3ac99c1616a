//===- Schedule.cpp - Schedule of a variant as text -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Passes leave notes of what they choose. How lanes find their elements and
// where sums are made is plain to see in phase `launch`, and is read from
// there.
//
//===----------------------------------------------------------------------===//

#include "Compilation.h"
#include "Transforms/Lanes/Neighbours.h"

#include "WarpDialect/LaneOps.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;
using warp::Choice;

static int getLine(Operation *op) {
  FileLineColLoc place = warp::findSourceLocation(op->getLoc());
  return place ? int(place.getLine()) : 0;
}

/// How the lanes of an access find their elements: the form, and how that is
/// done.
static std::pair<std::string, std::string> describeForm(Operation *access,
                                                        warp::LaneForm form,
                                                        size_t components,
                                                        int64_t stride) {
  if (access->hasAttr(warp::attr::run)) {
    bool stores = isa<warp::StoreLanesOp>(access);
    return {"rows, transposed",
            (stores ? "each lane writes its own row, elements per store: "
                    : "each lane reads its own row, elements per load: ") +
                std::to_string(components)};
  }
  if (access->hasAttr(warp::attr::neighbours))
    return {
        "vectors, or gathered",
        "neighbouring threads have consecutive elements, except at borders"};
  if (form == warp::LaneForm::gather)
    return {"gathered", "elements of neighbouring threads are scattered"};
  if (stride != 1)
    return {"vectors, " + std::to_string(stride) + " apart",
            "constant stride between neighbouring threads"};
  if (components == 1)
    return {"vectors", "neighbouring threads have consecutive elements"};
  return {"vectors, permuted",
          "consecutive elements of " + std::to_string(components) + " numbers"};
}

/// Appends what an operation of phase `launch` shows; nothing for most.
static void describe(Operation *op, std::vector<Choice> &choices) {
  auto add = [&](const char *what, const std::string &value,
                 const std::string &reason) {
    choices.push_back({what, value, reason, getLine(op)});
  };
  if (auto load = dyn_cast<warp::LoadLanesOp>(op)) {
    auto [form, reason] =
        describeForm(op, load.getForm(), op->getNumResults(), load.getStride());
    add("load", form, reason);
  } else if (auto store = dyn_cast<warp::StoreLanesOp>(op)) {
    auto [form, reason] = describeForm(
        op, store.getForm(), store.getComponents().size(), store.getStride());
    add("store", form == "gathered" ? "scattered" : form, reason);
  } else if (isa<warp::UpdateLanesOp>(op)) {
    add("update", "lane by lane", "threads may update the same element");
  } else if (isa<warp::EachLaneOp>(op)) {
    add("lanes", "one after the other", "there is no vector form");
  } else if (isa<warp::AtomicComponentsOp>(op)) {
    if (op->getParentOfType<warp::OnceOp>())
      add("update", "one per group", "all threads update the same element");
    else
      add("update", "one per thread", "elements differ between threads");
  }
}

warp::Decisions warp::schedule(const Module &module,
                               const CompileOptions &options) {
  std::vector<Choice> seen = Compilation(module, options).describeLaunch();
  Compilation run(module, options);
  run.lowerTo(Phase::LLVM);
  run.translate();
  run.choices.insert(run.choices.end(), seen.begin(), seen.end());
  return {std::move(run.choices), std::move(run.code.schedule)};
}

std::vector<Choice> warp::Compilation::describeLaunch() {
  lowerTo(Phase::Launch);
  ContextLock lock;
  std::vector<Choice> found, choices;
  op->walk([&](Operation *inner) { describe(inner, found); });
  // A line with several of a kind is said once.
  for (Choice &choice : found)
    if (llvm::none_of(choices, [&](const Choice &other) {
          return other.what == choice.what && other.value == choice.value &&
                 other.line == choice.line;
        }))
      choices.push_back(std::move(choice));
  return choices;
}
