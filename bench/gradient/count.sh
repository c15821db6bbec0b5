#!/bin/sh
# count.sh PATH/OF/bench_gradient: instructions of steps and gradients, counted by callgrind; CSV.
set -eu
program=$1
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
count() {
    valgrind --tool=callgrind --collect-atstart=no --toggle-collect=measured \
        --callgrind-out-file="$out/counts" "$program" count "$1" "$2" >/dev/null 2>"$out/log" ||
        { cat "$out/log" >&2; exit 1; }
    sed -n 's/^.*Collected : \([0-9]*\).*$/\1/p' "$out/log"
}
echo "scene,what,instructions per step,over forward"
for scene in "0 stack of 10 under a pendulum" "1 chain of 10" "3 pile of 40"; do
    k=${scene%% *}
    forward=$(count "$k" 0)
    for what in "0 forward" "1 recorded" "2 backward by q0" "3 backward by all" \
        "4 backward by all with checkpoints"; do
        n=$(count "$k" "${what%% *}")
        echo "${scene#* },\"${what#* }\",$((n / 60)),$(awk "BEGIN { printf \"%.3f\", $n / $forward }")"
    done
done
