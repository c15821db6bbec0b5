#!/bin/sh
# namespace.sh PROGRAM: runs PROGRAM CASE in a private network namespace, where nothing is routed
# ("unrouted"), and then with multicast on loopback ("routed").  77: the system does not let us.
if ! unshare -rn true 2>/dev/null; then
    echo "skipped: this system forbids private network namespaces (unshare -rn)"
    exit 77
fi
if ! command -v ip >/dev/null; then
    echo "skipped: there is no 'ip' command (package iproute2)"
    exit 77
fi
exec unshare -rn sh -ec '
    ip link set lo up
    "$1" unrouted
    ip link set lo multicast on
    ip route add 224.0.0.0/4 dev lo
    "$1" routed' sh "$1"
