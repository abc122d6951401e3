#!/usr/bin/env bash
# All tests of mapweld, from nothing but a Debian machine with a Rust toolchain:
#   tests/run.sh            everything
#   tests/run.sh NAME...    only tests whose names contain NAME
# Installs what is missing; the tests start their own servers on free ports in temporary folders.
set -euo pipefail
cd "$(dirname "$0")/.."

tests/packages.sh
cargo test --locked --all-features --no-fail-fast -- "$@"
