//===- Translation.h - Translation of a function ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A front end that can name all that a kernel is made from, before it makes it,
// keeps the translation under that name, beside the compiled code: what
// launches need to know of the kernel, the hashes that compiled code is found
// by, and the text of its module. The text is parsed only when something asks
// for the module: a variant that was never compiled, or a derivative.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSLATION_H
#define WARP_TRANSLATION_H

#include "warp/Compile.h"
#include "warp/Export.h"

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace warp {

/// Hexadecimal hashes of the text of a module, without and with locations.
struct SourceHashes {
  std::string plain, located;
};

/// `text`, if given, gets the text with locations.
WARP_API SourceHashes sourceHashes(const Module &module,
                                   std::string *text = nullptr);

/// `fingerprint` of the module that has these hashes.
WARP_API std::string fingerprint(const SourceHashes &hashes,
                                 const CompileOptions &options);

struct Translation {
  SourceHashes hashes;
  std::vector<Param> params;
  std::vector<Access> accesses;
  /// Dimensions of the thread index that the kernel reads.
  int rank = 1;
  /// The facts that the front end looks up again.
  std::string notes;
  /// The module, with locations.
  std::string text;
};

/// The translation of a name of 64 hexadecimal digits; nothing if there is
/// none, or if it is damaged.
WARP_API std::optional<Translation> findTranslation(const std::string &name);
WARP_API void storeTranslation(const std::string &name,
                               const Translation &translation);

class KernelClaim;

/// The right of one process to translate what has a name. The others of the
/// host wait in the constructor until it is given back, two seconds at most.
class WARP_API TranslationClaim {
public:
  explicit TranslationClaim(const std::string &name);
  ~TranslationClaim();
  /// True if another process had it: the translation may be there now.
  bool hasWaited() const;

private:
  std::unique_ptr<KernelClaim> claim;
};

/// The file format, exposed for tests.
WARP_API std::string serialize(const std::string &name,
                               const Translation &translation);
WARP_API std::optional<Translation>
deserializeTranslation(const std::string &name, const std::string &bytes);

/// The name of the kernel, as the text says it.
WARP_API std::string kernelNameOf(const Translation &translation);

} // namespace warp

#endif // WARP_TRANSLATION_H
