#!/bin/bash
# build/device: what test/device/run.sh needs on a machine without LLVM and
# without a network: libwarp.so (stripped, xz), its components and the generated
# Python files.
# Everything else that it uses is in the source tree.
#   make_device_bundle.sh [BUILD]   the build to take (default: build)
set -euo pipefail
cd "$(dirname "$0")/.."

strip_tool=/usr/lib/llvm-22/bin/llvm-strip
package=${1:-build}/python/warp
bundle=build/device
mkdir -p "$bundle"
if [ ! "$bundle/libwarp.so.xz" -nt "$package/libwarp.so" ] ||
  [ "$package" != "$(cat "$bundle/origin" 2>/dev/null)" ]; then
  "$strip_tool" -o "$bundle/libwarp.so" "$package/libwarp.so"
  xz -T0 -4 -f "$bundle/libwarp.so"
  echo "$package" >"$bundle/origin"
fi
rm -f "$bundle"/libwarp_*.so
for component in "$package"/libwarp_*.so; do
  "$strip_tool" -o "$bundle/$(basename "$component")" "$component"
done
cp "$package"/_src/{builtin_table,builtin_calls,device_table}.py \
  "$package"/include/warp/{HandleKinds,LaunchContract.h}.inc \
  "$package"/{__init__,config}.pyi "$bundle/"
du -ch "$bundle"/* | sed 's/^/device bundle: /'
