#!/bin/sh
# check-docs.sh: the programs in README.md are the files they name, links lead somewhere, the index
# lists every page, and the equations that the code cites exist.
set -eu
cd -- "$(dirname -- "$0")/.."
errors=0
error() {
    echo "$*"
    errors=$((errors + 1))
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The first fenced block after a line that names the file.
block_after() {
    awk -v name="$1" '
        inside && /^```/ { exit }
        inside { print }
        seen && /^```/ { inside = 1 }
        index($0, name) { seen = 1 }' README.md
}

for example in clients/examples/*.c clients/examples/*.py; do
    block_after "$example" >"$work/block"
    [ -s "$work/block" ] || error "README.md does not show $example"
    diff "$example" "$work/block" || error "README.md shows another $example"
done
for example in embed.c lcm_client.c client.py; do
    lines=$(wc -l <"clients/examples/$example")
    [ "$lines" -le 20 ] || error "clients/examples/$example has $lines lines, more than 20"
done

for page in $(find . -name '*.md' -not -path './build*' -not -path './out/*' | sort); do
    grep -oE '\]\([^)]+\)' "$page" | sed 's/^](//; s/)$//; s/#.*//' >"$work/links" || true
    while IFS= read -r link; do
        case $link in
        '' | *://*) ;;
        *) [ -e "${page%/*}/$link" ] || error "$page: there is no $link" ;;
        esac
    done <"$work/links"
done

for page in docs/*.md docs/math/*.md; do
    link=${page#docs/}
    [ "$link" = README.md ] || grep -qF "]($link)" docs/README.md || error "docs/README.md does not list $link"
done

# Pages that the code refers to.
grep -rhoE --include='*.[ch]' --include='*.py' --include='*.lcm' 'docs/[a-z/_-]+\.md' \
    libgeom libsolver proto daemon clients tests bench | sort -u >"$work/pages"
while IFS= read -r page; do
    [ -f "$page" ] || error "the code refers to $page, which does not exist"
done <"$work/pages"

grep -rhoE --include='*.[ch]' --include='*.py' '(equations\.md|EQUATIONS) \([0-9]+\)' \
    libgeom libsolver proto daemon clients tests | sed 's/.*(//; s/)//' | sort -nu >"$work/cited"
while IFS= read -r number; do
    grep -q "^($number) " docs/math/equations.md ||
        error "equation ($number) is cited, but docs/math/equations.md has none"
done <"$work/cited"
[ -s "$work/cited" ] || error "no citation of an equation found: this script looks in the wrong place"

echo "$(wc -l <"$work/cited") equations cited, $errors errors"
[ $errors -eq 0 ]
