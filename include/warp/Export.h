//===- Export.h - symbol visibility -----------------------------*- C++ -*-===//
//
// libwarp.so is compiled with hidden visibility; WARP_API marks what it
// exports: functions, and whole classes that are thrown, derived from or
// used with RTTI on the other side of the library boundary.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_EXPORT_H
#define WARP_EXPORT_H

#define WARP_API __attribute__((visibility("default")))

#endif // WARP_EXPORT_H
