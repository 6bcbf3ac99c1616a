//===- Variant.h - The options of a compilation -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `CompileOptions` is what the runtime asks for, `#warp.variant` what passes
// read, and text what is written on the command line and hashed. All three
// meet here and nowhere else, and so do `#warp.schedule` and `Schedule`.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_VARIANT_H
#define WARP_LIB_TRANSFORMS_VARIANT_H

#include "WarpDialect/WarpAttributes.h"
#include "warp/Compile.h"

#include "mlir/IR/Diagnostics.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// The variant that these options are for; null, with an error, if there is no
/// such launch.
VariantAttr
getVariant(mlir::MLIRContext *context, const CompileOptions &options,
           llvm::function_ref<mlir::InFlightDiagnostic()> emitError);

/// Marks a kernel for a launch with these options; false, with an error, if
/// there is no such launch.
bool setVariant(mlir::FunctionOpInterface kernel,
                const CompileOptions &options);

/// A schedule as the runtime has it, but for what is read off the code.
Schedule readSchedule(ScheduleAttr schedule);

/// Sets one option; false if there is none of that name, or no such value of
/// it. A flag without a value is set.
bool setOption(CompileOptions &options, llvm::StringRef key,
               llvm::StringRef value);

/// The reason why `setOption` is false.
std::string describeBadOption(llvm::StringRef key, llvm::StringRef value);

/// Calls `set` for each `key` or `key=value` of a text, which commas or blanks
/// separate, until it fails.
mlir::LogicalResult parseOptions(
    llvm::StringRef text,
    llvm::function_ref<mlir::LogicalResult(llvm::StringRef, llvm::StringRef)>
        set);

/// Every option that code depends on, as `key=value` with blanks between.
std::string toText(const CompileOptions &options);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_VARIANT_H
