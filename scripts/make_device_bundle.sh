#!/bin/bash
# build/device: what test/device/run.sh needs on a machine without LLVM and
# without a network: libwarp.so (stripped, xz) and the generated Python files.
# Everything else that it uses is in the source tree.
set -euo pipefail
cd "$(dirname "$0")/.."

strip_tool=/usr/lib/llvm-22/bin/llvm-strip
package=build/python/warp
bundle=build/device
mkdir -p "$bundle"
if [ ! "$bundle/libwarp.so.xz" -nt "$package/libwarp.so" ]; then
  "$strip_tool" -o "$bundle/libwarp.so" "$package/libwarp.so"
  xz -T0 -4 -f "$bundle/libwarp.so"
fi
cp "$package/_src/builtin_table.py" "$package/__init__.pyi" "$bundle/"
du -ch "$bundle"/* | sed 's/^/device bundle: /'
