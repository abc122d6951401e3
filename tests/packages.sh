#!/usr/bin/env bash
# Installs, by package name, what building and testing need and this machine lacks (as root, or by sudo).
set -euo pipefail

as_root() {
  if [ "$(id -u)" = 0 ]; then "$@"; elif command -v sudo >/dev/null; then sudo "$@"; else return 1; fi
}

# A C compiler for SQLite and the TLS library; an independent reader of map_server files with the compiler for it; a
# PostgreSQL for the tests to start clusters of their own; a browser that can be driven; Python for schemathesis.
packages=(gcc libc6-dev g++ cmake pkg-config libmrpt-maps-dev postgresql chromium-driver
  python3-venv)
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0
echo "installing ${missing[*]}"
export DEBIAN_FRONTEND=noninteractive
{ as_root apt-get update -qq && as_root apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null; } ||
  echo "NOT INSTALLED: ${missing[*]} (no rights or no network); tests that need them will say that they are skipped" >&2
