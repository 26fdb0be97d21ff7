#!/usr/bin/env bash
# setup.sh demo|bench|gl|peers|test: installs the Debian packages that are missing and that the make
# target of that name (gl, peers: bench-...) needs, as root or by sudo, and says so. Where it cannot,
# it names them and fails.
set -u

programs="make gcc libc6-dev libstb-dev libnanovdb-dev libnanovdb-tools"
reference="libgsl-dev"
compilers="g++ clang tcc gcc-mingw-w64-x86-64 g++-mingw-w64-x86-64 binutils"
checks="libcmocka-dev libmpfr-dev glslang-tools pkg-config cmake libegl1 libgl-dev libgl1-mesa-dri libosmesa6 libglm-dev"

case "${1-}" in
demo) packages="$programs" ;;
bench) packages="$programs $reference libopenvdb-tools gnuplot-nox" ;;
gl) packages="$programs $reference gnuplot-nox libegl1 libgl1-mesa-dri" ;;
peers) packages="$programs $reference libopenvdb-tools povray" ;;
test) packages="$programs $reference $compilers $checks" ;;
*) echo "usage: setup.sh demo|bench|gl|peers|test" >&2; exit 2 ;;
esac

# Prints those of the named packages that are not installed.
missing() {
    local name installed
    installed=$(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "$@" 2>/dev/null)
    for name in "$@"; do
        grep -qx "installed $name" <<<"$installed" || echo "$name"
    done
}

# Runs a command as root, without ever waiting for an answer where nobody can give one.
as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"
    elif [ -t 0 ]; then sudo "$@"
    else sudo -n "$@"
    fi
}

can_be_root() {
    [ "$(id -u)" = 0 ] || command -v sudo >/dev/null
}

get() {
    as_root env DEBIAN_FRONTEND=noninteractive apt-get -q -y -o DPkg::Lock::Timeout=300 "$@" \
        </dev/null >/dev/null
}

install() {
    [ $# -gt 0 ] || return 0
    if can_be_root && echo "setup: installing $*" && get update &&
        get install --no-install-recommends "$@"; then
        echo "setup: installed"
        return 0
    fi
    echo "setup: cannot install them here; as root: apt-get install $*" >&2
    exit 1
}

if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
    echo "setup: this is not Debian or Ubuntu; what is needed is called there: $packages"
    exit 0
fi
# 32-bit libraries stand beside the native ones on this architecture only.
if [ "$1" = test ] && [ "$(dpkg --print-architecture)" = amd64 ]; then
    packages="$packages gcc-multilib g++-multilib"
fi
# shellcheck disable=SC2046,SC2086
install $(missing $packages)
# The sanitizers and the fuzzer of clang are in a package named after its version.
if [ "$1" = test ] && ! ls "$(clang -print-runtime-dir)"/libclang_rt.fuzzer* >/dev/null 2>&1; then
    install "libclang-rt-$(clang -dumpversion | cut -d. -f1)-dev"
fi
