//===- Error.h - The one exception of the public API ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Everything that can go wrong because of user input is thrown as
// `warp::Error`. It carries the place in the user's Python source when there
// is one; the binding turns it into the exception class that `kind` names.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_ERROR_H
#define WARP_ERROR_H

#include "warp/Export.h"

#include <exception>
#include <string>
#include <utility>

namespace warp {

class WARP_API Error : public std::exception {
public:
  enum class Kind {
    Type,        ///< operand or argument of a wrong type
    Value,       ///< right type, impossible value
    Index,       ///< constant index or component out of range
    Attribute,   ///< no such component or field
    Key,         ///< no such builtin or function
    Overflow,    ///< number does not fit its type
    Parse,       ///< malformed IR text
    Compile,     ///< a pass or the code generator failed
    Launch,      ///< a launch that cannot run, or whose checks failed
    LaunchType,  ///< launch argument of a wrong type, rank or device
    LaunchValue, ///< launch extent or option with an impossible value
    Runtime,     ///< a device or the operating system refused
    Memory,      ///< an allocation does not fit
  };

  Error(Kind kind, std::string message, std::string file = {}, int line = 0,
        int column = 0)
      : kind(kind), message(std::move(message)), file(std::move(file)),
        line(line), column(column) {}

  const char *what() const noexcept override { return message.c_str(); }

  Kind kind;
  std::string message;
  std::string file;
  int line;
  int column;
};

} // namespace warp

#endif // WARP_ERROR_H
