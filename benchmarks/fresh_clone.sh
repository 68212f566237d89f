#!/usr/bin/env bash
# A newcomer's first minutes: clone, virtual environment, README's two commands, in surroundings that have nothing.
#
#     benchmarks/fresh_clone.sh [TESTS...]        default: the whole suite, as README says
#
# HOME is empty during the installation and the first command, then a folder that nothing can be written to; there is no display, no
# terminal, and after the installation no network (needs `unshare` and `ip`, as root or with user namespaces). The reference
# material that the tests compare with has to lie beside this checkout in ../shared.
set -euo pipefail
source=$(cd "$(dirname "$0")/.." && pwd)
place=$(mktemp -d)
trap 'chmod -R u+w "$place"; rm -rf "$place"' EXIT
mkdir "$place/home" "$place/locked"
chmod 555 "$place/locked"
ln -s "$(dirname "$source")/shared" "$place/shared"

git clone --quiet "$source" "$place/main"
python3 -m venv "$place/venv"
cd "$place/main"

# No terminal, no display, an empty environment but for the way to the interpreter and to the package index.
bare() {
    local home=$1
    shift
    env -i "${pip_settings[@]}" PATH="$place/venv/bin:/usr/bin:/bin" HOME="$home" TMPDIR="${TMPDIR:-/tmp}" LANG=C.UTF-8 \
        setsid --wait "$@" </dev/null
}
mapfile -t pip_settings < <(env | grep '^PIP_' || true)
# HOME is mounted read-only, for who may write everything: permissions do not stop the superuser. A machine without a network can
# still speak to itself (the tests' cluster does).
isolated='mount --bind "$0" "$0" && mount -o "remount,bind,$1" "$0" && ip link set lo up && shift && exec "$@"'
without_network() { bare "$1" unshare --net --mount bash -c "$isolated" "$@"; }
told() { printf '%-48s %5d s\n' "$1" "$((SECONDS - began))"; }

began=$SECONDS
bare "$place/home" pip install --quiet --disable-pip-version-check -e .
told "pip install -e ."
began=$SECONDS
without_network "$place/home" rw rrrid run sample_logs/rrr-changed >"$place/said" 2>&1 || { cat "$place/said"; exit 1; }
head -n 1 "$place/said"
told "rrrid run sample_logs/rrr-changed, empty HOME"
began=$SECONDS
without_network "$place/locked" ro rrrid run sample_logs/rrr-changed --no-cache --out "$place/again" >/dev/null
told "the same, HOME read-only"
began=$SECONDS
bare "$place/home" pip install --quiet --disable-pip-version-check -e '.[test]'
told "pip install -e '.[test]'"
began=$SECONDS
without_network "$place/locked" ro pytest -q -n auto "$@"
told "pytest -n auto, HOME read-only"
