//===- RegionBuilder.h - Formulas of access regions -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_REGIONBUILDER_H
#define WARP_LIB_ANALYSIS_REGIONBUILDER_H

#include "Analysis/ArrayOrigins.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"
#include "warp/Regions.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

#include "llvm/ADT/DenseMap.h"

namespace warp {

/// A node plus multiples of symbols.
struct IndexForm {
  /// How many one index may have; more are any index.
  static constexpr size_t most = 4;

  /// `factor` times 0, 1, ... below `count`, nodes both. Symbols are the same
  /// if their keys are: a thread dimension, or the counter of a loop.
  struct Symbol {
    const void *key;
    int32_t factor, count;
  };
  int32_t base = 0;
  llvm::SmallVector<Symbol, 2> symbols;
};

/// The values an index may have; anything if there are none.
using IndexForms = llvm::SmallVector<IndexForm, 1>;

class RegionBuilder {
public:
  explicit RegionBuilder(mlir::func::FuncOp kernel);
  RegionFormula run();

private:
  using Kind = RegionFormula::Op;
  using Join = llvm::function_ref<std::optional<IndexForm>(const IndexForm &,
                                                           const IndexForm &)>;

  // Nodes.
  int32_t node(Kind op, int64_t a, int64_t b = 0, mlir::Type type = {});
  int32_t constant(int64_t value) { return node(Kind::Constant, value); }
  std::optional<int64_t> constantOf(int32_t node) const;
  int32_t combine(Kind op, int32_t a, int32_t b, mlir::Type type = {});

  // Values.
  const IndexForms &formsOf(mlir::Value value);
  IndexForms compute(mlir::Value value);
  IndexForms ofResult(mlir::OpResult value);
  IndexForms ofThread(unsigned dim);
  IndexForms ofCast(CastOp cast);
  IndexForms ofSum(mlir::Operation *op, bool negate);
  IndexForms ofNegation(mlir::Operation *op);
  IndexForms ofProduct(mlir::Operation *op);
  IndexForms ofExtremum(Kind kind, mlir::Operation *op);
  IndexForms ofArgument(mlir::BlockArgument argument);
  IndexForms ofField(StructGetOp get);
  IndexForms ofExtent(DimOp dim);
  IndexForms ofCounter(mlir::scf::ForOp loop);
  IndexForms ofUniform(Kind op, mlir::Operation *operation);
  IndexForms pairs(mlir::Operation *op, Join join);
  IndexForms any(llvm::ArrayRef<mlir::Value> values);
  IndexForm sum(const IndexForm &a, const IndexForm &b, bool negate);
  IndexForm scaled(const IndexForm &form, int32_t factor, mlir::Type type);

  // Accesses.
  void visit(mlir::Operation *op);
  void add(AccessOp op);
  void add(TileAccessOp op);
  std::optional<unsigned>
  leafOf(mlir::Value array, llvm::SmallVectorImpl<const IndexForms *> &indices);
  void markUnknown(mlir::Value array);
  bool collectIndices(mlir::Value array,
                      llvm::SmallVectorImpl<const IndexForms *> &indices,
                      mlir::Value &root);
  void addChoices(RegionFormula::Access access,
                  llvm::ArrayRef<const IndexForms *> indices);

  mlir::func::FuncOp kernel;
  ArrayOrigins origins;
  ParameterLayout layout;
  llvm::SmallVector<int64_t> offsets;
  RegionFormula formula;
  llvm::DenseMap<mlir::Value, std::unique_ptr<IndexForms>> known;
  const IndexForms unknown;
};

} // namespace warp

#endif // WARP_LIB_ANALYSIS_REGIONBUILDER_H
