#!/bin/sh
# run.sh static|shared|solver FOLDER: builds and installs carom into a folder, moves it elsewhere,
# and uses it from there by CMake and by pkg-config, in C and in C++.
# run.sh parent FOLDER: builds a project that holds carom as a subfolder.
set -eu
kind=$1
mkdir -p "$2"
work=$(cd "$2" && pwd)/$kind
here=$(cd -- "$(dirname -- "$0")" && pwd)
source=$(cd "$here/../.." && pwd)
jobs=${JOBS:-$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)}

fail() {
    echo "install $kind: $*" >&2
    exit 1
}

if [ "$kind" = parent ]; then
    cmake -S "$here/parent" -B "$work" -DCMAKE_BUILD_TYPE=Release
    cmake --build "$work" --parallel "$jobs"
    cd "$work"
    exec ctest --output-on-failure
fi

case $kind in
static) set -- -DBUILD_SHARED_LIBS=OFF ;;
shared) set -- -DBUILD_SHARED_LIBS=ON ;;
# The solver alone needs no other library than SuiteSparse: the rest is hidden from CMake.
solver) set -- -DCAROM_BUILD_WORLD=OFF -DCMAKE_DISABLE_FIND_PACKAGE_Libccd=ON \
    -DCMAKE_DISABLE_FIND_PACKAGE_LCM=ON -DCMAKE_DISABLE_FIND_PACKAGE_Jansson=ON ;;
*) fail "no such kind" ;;
esac

rm -rf "$work/prefix" "$work/moved" "$work/use" "$work/pkg"
cmake -S "$source" -B "$work/build" -DCMAKE_BUILD_TYPE=Release -DCMAKE_INSTALL_PREFIX="$work/prefix" \
    -DCAROM_BUILD_TESTS=OFF -DCAROM_BUILD_EXAMPLES=OFF -DCAROM_WERROR="${CAROM_WERROR:-OFF}" "$@"
cmake --build "$work/build" --parallel "$jobs"
cmake --install "$work/build"
mv "$work/prefix" "$work/moved"
prefix=$work/moved

config=$(find "$prefix" -name carom-config.cmake)
components=$(sed -n 's/^set(carom_components \(.*\))$/\1/p' "$config" | tr ';' ' ')
echo "components: $components"
case $kind in
solver) expected="base solver" ;;
*) expected="base geom solver carom client" ;;
esac
for component in $expected; do
    case " $components " in
    *" $component "*) ;;
    *) fail "component $component is not installed" ;;
    esac
done
if [ "$kind" = solver ] && [ "$components" != "$expected" ]; then
    fail "components '$components', expected '$expected'"
fi
if grep -rlE "$source/|$work/(build|prefix)" "$(dirname "$config")" "$prefix"/lib*/pkgconfig "$prefix"/include; then
    fail "these installed files name folders of the build"
fi
if [ "$kind" != solver ]; then
    for header in "$source"/lib*/include/carom/*.h "$source"/clients/c/include/carom/*.h; do
        [ -f "$prefix/include/carom/${header##*/}" ] || fail "${header##*/} is not installed"
    done
fi

echo "--- CMake"
cmake -S "$here" -B "$work/use" -DCMAKE_PREFIX_PATH="$prefix" \
    -DCOMPONENTS="$(echo "$components" | tr ' ' ';')"
cmake --build "$work/use" --parallel "$jobs"
(cd "$work/use" && ctest --output-on-failure)

echo "--- pkg-config"
PKG_CONFIG_PATH=$(dirname "$(find "$prefix" -name carom-base.pc)")
LD_LIBRARY_PATH=$(dirname "$PKG_CONFIG_PATH")
export PKG_CONFIG_PATH LD_LIBRARY_PATH
mkdir "$work/pkg"
for component in $components; do
    name=carom-$component
    [ "$component" = carom ] && name=carom
    program=$work/pkg/use_$component
    # The flags are words on purpose.
    # shellcheck disable=SC2046
    {
        "${CC:-cc}" -std=c99 "$here/use_$component.c" -o "$program" $(pkg-config --cflags --libs "$name")
        "${CXX:-c++}" -x c++ -std=c++11 "$here/use_$component.c" -x none -o "$program++" \
            $(pkg-config --cflags --libs "$name")
    }
    "$program"
    "$program++"
    echo "$name $(pkg-config --modversion "$name"): C and C++"
done

if [ "$kind" = shared ]; then
    echo "--- exported names"
    for library in "$prefix"/lib*/libcarom*.so; do
        if nm -D --defined-only "$library" | grep -vE ' (carom_|_init$|_fini$)'; then
            fail "$library exports these names, which are not carom_*"
        fi
    done
fi
if [ "$kind" != solver ]; then
    for program in carom caromd; do
        env -u LD_LIBRARY_PATH "$prefix/bin/$program" --version || fail "$program does not start"
    done
fi
