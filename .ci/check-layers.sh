#!/bin/sh
# check-layers.sh [LIBRARY.a ...]: the rules of docs/style.md that a compiler does not check.
#   Includes only go down:  base < libgeom < world < grad < daemon
#                           base < lcp < contact < world
#   lcp and contact know no geometry; clients see public headers and messages only; one file calls
#   libccd; the libraries never print, exit or read the environment, and (where built libraries are
#   named) hold no mutable global.
set -eu
cd -- "$(dirname -- "$0")/.."
errors=0
error() {
    echo "$*"
    errors=$((errors + 1))
}

# layer PATH: sets `layer` of a file of this project.
layer() {
    case $1 in
    libgeom/base/* | libgeom/include/carom/base.h) layer=base ;;
    libgeom/*) layer=geom ;;
    libsolver/lcp/* | libsolver/include/carom/lcp.h) layer=lcp ;;
    libsolver/contact/* | libsolver/include/carom/contact.h) layer=contact ;;
    libsolver/world/* | libsolver/include/carom/world.h | libsolver/include/carom/world_query.h | libsolver/include/carom/snapshot.h | libsolver/include/carom/events.h) layer=world ;;
    libsolver/grad/* | libsolver/include/carom/grad.h) layer=grad ;;
    libsolver/include/carom/carom.h) layer=all ;;
    proto/*) layer=proto ;;
    daemon/*) layer=daemon ;;
    clients/*) layer=clients ;;
    *) layer=unknown ;;
    esac
}

# allowed LAYER: sets `allowed`, the layers whose headers it may include.
allowed() {
    case $1 in
    base) allowed=base ;;
    geom) allowed="base geom" ;;
    lcp) allowed="base lcp" ;;
    contact) allowed="base lcp contact" ;;
    world) allowed="base geom lcp contact world" ;;
    grad) allowed="base geom lcp contact world grad" ;;
    all) allowed="base geom lcp contact world grad" ;;
    proto) allowed=proto ;;
    daemon) allowed="base geom lcp contact world grad all proto daemon" ;;
    clients) allowed="base geom lcp contact world grad all proto clients" ;;
    esac
}

# resolve FILE NAME: sets `found` to the project's file that #include "NAME" in FILE means, or empty
# for generated messages and other people's headers.
resolve() {
    for found in "${1%/*}/$2" "$2" "libgeom/include/$2" "libsolver/include/$2" \
        "clients/c/include/$2" "libgeom/$2" "libsolver/$2" "proto/$2" "daemon/$2" "clients/c/$2"; do
        [ ! -f "$found" ] || return 0
    done
    found=
}

sources=$(find libgeom libsolver proto daemon clients -name '*.[ch]' | sort)
includes=$(mktemp)
trap 'rm -f "$includes"' EXIT
# The sources are words on purpose: no name has a blank.
# shellcheck disable=SC2086
grep -nE '^[[:space:]]*#[[:space:]]*include' $sources >"$includes" || true

n=0
while IFS=: read -r file line text; do
    name=${text#*[\"<]}
    name=${name%%[\">]*}
    layer "$file"
    mine=$layer
    n=$((n + 1))
    case $mine:$name in
    base:lcm/* | geom:lcm/* | lcp:lcm/* | contact:lcm/* | world:lcm/* | grad:lcm/* | *:jansson.h)
        [ "$mine" = clients ] || error "$file:$line: $mine includes <$name>"
        ;;
    geom:ccd/*) ;;
    *:ccd/*) error "$file:$line: $mine includes <$name>" ;;
    esac
    resolve "$file" "$name"
    if [ -z "$found" ]; then
        case $name in
        carom/* | lib*/* | daemon/* | clients/*) error "$file:$line: there is no \"$name\"" ;;
        esac
        continue
    fi
    while [ "${found#*/../}" != "$found" ]; do
        found=$(printf '%s\n' "$found" | sed 's|[^/]*/\.\./||')
    done
    layer "$found"
    allowed "$mine"
    case " $allowed " in
    *" $layer "*) ;;
    *) error "$file:$line: $mine includes \"$name\", which is of $layer" ;;
    esac
    # Clients use what a user has: public headers.
    case $mine:$layer:$found in
    clients:clients:* | clients:proto:* | clients:*/include/carom/*) ;;
    clients:*) error "$file:$line: a client includes the internal \"$name\"" ;;
    esac
done <"$includes"
[ $n -gt 0 ] || error "no #include found: this script looks in the wrong place"

# shellcheck disable=SC2086
with_ccd=$(grep -lE '^[[:space:]]*#[[:space:]]*include[[:space:]]*<ccd/' $sources | wc -l)
[ "$with_ccd" -le 1 ] || error "$with_ccd files include <ccd/...>, one may"

calls='(^|[^A-Za-z0-9_])(v?f?printf|f?puts|f?putc|putchar|perror|exit|_Exit|_exit|abort|getenv|setenv|system)[[:space:]]*\('
if grep -rnE --include='*.[ch]' "$calls|(^|[^A-Za-z0-9_])(stdout|stderr)([^A-Za-z0-9_]|$)" \
    libgeom libsolver; then
    error "the libraries print, exit or read the environment (lines above)"
fi

for library in "$@"; do
    globals=$(objdump -t "$library" |
        awk 'NF >= 5 && $(NF - 2) ~ /^(\.data|\.bss|\*COM\*)$/ && $NF !~ /^\./ { print $NF }')
    [ -z "$globals" ] || error "$library holds mutable globals:" "$globals"
done

echo "$n includes, $errors errors"
[ $errors -eq 0 ]
