#!/bin/sh
# check-options.sh quick|full FOLDER: every declared option, both ways.
#   quick  configures each value and builds the libraries without KLU
#   full   builds each value that is not the default, and runs the tests it leaves
set -eu
mode=$1
mkdir -p "$2"
work=$(cd "$2" && pwd)
cd -- "$(dirname -- "$0")/.."
jobs=${JOBS:-$(getconf _NPROCESSORS_ONLN 2>/dev/null || echo 2)}
werror=${CAROM_WERROR:-OFF}

fail() {
    echo "options: $*" >&2
    exit 1
}

# configure NAME OPTION...: a fresh folder; an option that no line of CMake reads is an error.
configure() {
    name=$1
    shift
    echo "--- $name: $*"
    rm -rf "${work:?}/$name"
    cmake -S . -B "$work/$name" "$@" >"$work/$name.log" 2>&1 || {
        tail -n 50 "$work/$name.log"
        fail "$* does not configure"
    }
    if grep -A 5 'Manually-specified variables were not used' "$work/$name.log"; then
        fail "$* is not read"
    fi
}

refuse() {
    echo "--- refused: $*"
    rm -rf "${work:?}/refused"
    if cmake -S . -B "$work/refused" "$@" >"$work/refused.log" 2>&1; then
        fail "$* configures, and should not"
    fi
    grep -q 'CAROM_SANITIZE' "$work/refused.log" || fail "$*: the error does not name the option"
}

build() {
    echo "    build $1"
    cmake --build "$work/$1" --parallel "$jobs" >"$work/$1-build.log" 2>&1 || {
        tail -n 50 "$work/$1-build.log"
        fail "$1 does not build"
    }
}

# without NAME PATTERN: no symbol of its binaries, defined or wanted, and no library that they load
# matches.
without() {
    found=$(find "$work/$1" \( -name '*.a' -o -name '*.so*' \) -type f)
    [ -n "$found" ] || fail "$1 has no library"
    for library in $found; do
        traces=$({
            nm -P "$library" 2>/dev/null | cut -d ' ' -f 1
            readelf -d "$library" 2>/dev/null | sed -n 's/.*(NEEDED).*\[\(.*\)\]/\1/p'
        } | grep -E "$2" || true)
        [ -z "$traces" ] || fail "$library has traces of what was left out:" "$traces"
    done
    echo "    no trace of $2"
}

run_tests() {
    [ -f "$work/$1/CTestTestfile.cmake" ] || return 0
    (cd "$work/$1" && ctest --output-on-failure -LE long -j "$jobs") >"$work/$1-test.log" 2>&1 || {
        tail -n 50 "$work/$1-test.log"
        fail "$1: tests fail"
    }
    grep 'tests passed' "$work/$1-test.log" || true
}

options="BUILD_SHARED_LIBS CAROM_BUILD_WORLD CAROM_BUILD_DAEMON CAROM_BUILD_CLIENTS CAROM_WITH_KLU
CAROM_BUILD_TESTS CAROM_BUILD_BENCH CAROM_BUILD_EXAMPLES CAROM_CHECKS CAROM_WERROR"
declared=$(sed -n 's/^option(\([A-Z_]*\).*/\1/p' CMakeLists.txt)
for option in $declared; do
    case " $(echo "$options" | tr '\n' ' ') " in
    *" $option "*) ;;
    *) fail "$option is declared, but not checked here" ;;
    esac
    grep -q "$option" docs/development.md || fail "$option is not in docs/development.md"
done

set_by_user=$(grep -hoE 'set\(CAROM_[A-Z_]+ .* CACHE' CMakeLists.txt tests/python/CMakeLists.txt |
    sed 's/set(//; s/ .*//')
for option in $set_by_user; do
    grep -q "$option" docs/development.md || fail "$option is not in docs/development.md"
done

default() {
    sed -n "s/^option($1 .* \([^ ]*\))\$/\1/p" CMakeLists.txt | sed 's/.{CAROM_TOP}/ON/'
}

for option in $options; do
    for value in ON OFF; do
        name=$option-$value
        if [ "$mode" = quick ]; then
            configure "$name" "-D$option=$value"
        elif [ "$(default "$option")" != $value ]; then
            set -- "-D$option=$value"
            [ "$option" = CAROM_WERROR ] || set -- "$@" "-DCAROM_WERROR=$werror"
            configure "$name" "$@"
            build "$name"
            run_tests "$name"
        fi
    done
done
for value in '' 'address;undefined' thread; do
    configure "sanitize-$(echo "$value" | tr ';' '-')" "-DCAROM_SANITIZE=$value"
done
refuse -DCAROM_SANITIZE=everything
refuse '-DCAROM_SANITIZE=address;thread'
refuse -DCAROM_SANITIZE=memory -DCMAKE_C_COMPILER=gcc
if [ "$mode" = quick ]; then
    configure no-klu -DCAROM_WITH_KLU=OFF -DCAROM_BUILD_TESTS=OFF -DCAROM_BUILD_EXAMPLES=OFF \
        -DCAROM_BUILD_DAEMON=OFF -DCAROM_BUILD_CLIENTS=OFF "-DCAROM_WERROR=$werror"
    build no-klu
    without no-klu '^(klu_|btf_|colamd|carom_lcp_)|lib(klu|btf|lcm)|lcm_|crm_wire|crm_session'
    configure bare -DCAROM_BUILD_WORLD=OFF -DCAROM_WITH_KLU=OFF -DCAROM_BUILD_TESTS=OFF \
        -DCAROM_BUILD_EXAMPLES=OFF -DCAROM_BUILD_DAEMON=OFF -DCAROM_BUILD_CLIENTS=OFF \
        -DBUILD_SHARED_LIBS=ON "-DCAROM_WERROR=$werror"
    build bare
    without bare '^(klu_|btf_|colamd|ccd|carom_(lcp|world|collide|tape)_)|lib(klu|btf|ccd|lcm)|lcm_'
fi
echo "every option works both ways"
