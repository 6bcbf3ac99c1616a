//===- ErrorRecords.cpp - Reports of failed checks ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A failed check leaves one record. Code of debug mode has checks, and code of
// the few operations that no mode goes on with. On the CPU the record lives on
// the stack of the launch; cuda/ErrorRecords.cpp says where on GPUs.
//
//===----------------------------------------------------------------------===//

#include "ErrorRecords.h"

#include "warp/Error.h"

#include <algorithm>
#include <string>

using namespace warp;

static std::string list(const std::string &name, int count,
                        const std::string *values) {
  std::string text = name + " (";
  for (int i = 0; i < count; ++i)
    text += (i ? ", " : "") + values[i];
  return text + (count == 1 ? ",)" : ")");
}

static std::string describeAccess(const ErrorRecord &record, const Site &site) {
  int rank = std::min<int>(record.rank, maxRank);
  std::string index[maxRank], shape[maxRank];
  for (int i = 0; i < rank; ++i) {
    // A negative index was counted from the end; say what was written.
    int64_t written = record.index[i];
    if (written < 0 && record.kind != CheckKind::Offset)
      written -= record.shape[i];
    index[i] = std::to_string(written);
    shape[i] = std::to_string(record.shape[i]);
  }
  std::string what = record.kind == CheckKind::OutOfBounds
                         ? "array '" + site.array + "'"
                         : site.array;
  return list("index", rank, index) + " is out of bounds for " + what + " of " +
         list("shape", rank, shape);
}

void warp::raiseFailedCheck(const ErrorRecord &record,
                            const std::vector<Site> &sites) {
  Site site;
  if (record.site >= 0 && record.site < static_cast<int>(sites.size()))
    site = sites[record.site];
  std::string message = "kernel '" + site.kernel + "': ";
  if (record.kind == CheckKind::Assertion)
    message += "assertion failed: " + site.array;
  else if (record.kind == CheckKind::Failure)
    message += site.array;
  else
    message += describeAccess(record, site);
  throw Error(Error::Kind::Launch, message, site.file, site.line, site.column);
}
