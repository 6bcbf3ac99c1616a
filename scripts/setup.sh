#!/bin/bash
# Everything between a clean clone on Debian 12 and a working tree: system
# packages, .venv with pinned PyPI packages, the build, the package installed
# into .venv. Each step is skipped when its result is already there.
#   setup.sh              all, with tools and tests
#   setup.sh package      what the Python package needs
#   setup.sh environment  the packages, no build
#
#   WHEEL         a wheel that is installed into .venv in place of a build
#   PYTHON        the interpreter .venv is made from (default: python3)
#   WARP_PRESET   the CMake preset of a first configuration (default: dev)
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf '%s\n' "setup: $*"; }

root() {
  if [ "$(id -u)" = 0 ]; then "$@"; else sudo "$@"; fi
}

install_system_packages() {
  local wanted=(clang-22 lld-22 llvm-22-dev llvm-22-tools libmlir-22-dev
    mlir-22-tools cmake ninja-build ccache libgtest-dev libgmock-dev
    libnanovdb-dev libopenvdb-dev libboost-dev libeigen3-dev zlib1g-dev libzstd-dev
    python3 python3-dev python3-venv xz-utils zstd advancecomp
    openmpi-bin libopenmpi-dev)
  local missing=() name
  for name in "${wanted[@]}"; do
    dpkg-query -W -f '${db:Status-Status}' "$name" 2>/dev/null |
      grep -qx installed || missing+=("$name")
  done
  [ ${#missing[@]} = 0 ] && return
  say "installing ${missing[*]}"
  root apt-get update -qq
  root env DEBIAN_FRONTEND=noninteractive \
    apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
}

make_venv() {
  [ -x .venv/bin/python ] || {
    say "creating .venv"
    "${PYTHON:-python3}" -m venv .venv
  }
  local stamp=.venv/requirements.stamp
  if ! cat requirements/*.txt | cmp -s - "$stamp"; then
    say "installing pinned PyPI packages into .venv"
    .venv/bin/python -m pip install -q --disable-pip-version-check \
      -r requirements/dev.txt
    cat requirements/*.txt >"$stamp"
  fi
}

build() {
  [ -f build/build.ninja ] || {
    say "configuring"
    mkdir -p build
    cmake --preset "${WARP_PRESET:-dev}" \
      -DPython_EXECUTABLE="$PWD/.venv/bin/python" >build/configure.log 2>&1 || {
      cat build/configure.log
      exit 1
    }
  }
  say "building; the first time takes about 7 minutes on two cores"
  # On a terminal Ninja's status line shows the progress.
  local quiet=--quiet
  [ -t 1 ] && quiet=
  NINJA_STATUS="[%f/%t, %e s] " ninja -C build $quiet "$@"
}

# A wheel of this version in place of a build.
install_wheel() {
  say "installing $1"
  .venv/bin/python -m pip install -q --disable-pip-version-check --force-reinstall --no-deps "$1"
  # The next build installs the package of this tree again.
  rm -f .venv/package.stamp
}

# The installed copy is refreshed when anything in build/python is newer.
install_package() {
  local stamp=.venv/package.stamp
  if [ -f "$stamp" ] &&
    [ -z "$(find -L build/python/warp -newer "$stamp" -type f \
      -not -name '*.pyc' -print -quit)" ]; then
    return
  fi
  say "installing the package into .venv"
  touch "$stamp.new"
  .venv/bin/python scripts/install_package.py
  mv "$stamp.new" "$stamp"
}

if [ -n "${WHEEL:-}" ]; then
  make_venv
  install_wheel "$WHEEL"
  exit
fi
install_system_packages
make_venv
case "${1:-all}" in
  environment) exit ;;
  package) build WarpPackage ;;
  *) build ;;
esac
install_package
