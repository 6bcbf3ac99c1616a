//===- ErrorRecords.h - Reports of failed checks ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_ERRORRECORDS_H
#define WARP_LIB_RUNTIME_ERRORRECORDS_H

#include "warp/Compile.h"
#include "warp/Launch.h"

#include <cstddef>
#include <cstring>
#include <vector>

namespace warp {

/// Tells a launch where checks report.
inline void setErrorRecord(void *params, uint64_t address) {
  std::memcpy(static_cast<char *>(params) + offsetof(LaunchHeader, errorRecord),
              &address, sizeof(address));
}

/// Throws the failed check that a kernel left in a record.
[[noreturn]] void raiseFailedCheck(const ErrorRecord &record,
                                   const std::vector<Site> &sites);

} // namespace warp

#endif // WARP_LIB_RUNTIME_ERRORRECORDS_H
