#!/usr/bin/env bash
# The service under load, on loopback, built for release: uploads a second and p50/p99 as a ratio to a bare handler, p99
# of /livez while all workers merge, and what is answered at three times the capacity. Prints the figures.
#   tests/load.sh [UPLOADS]       default 2000
set -euo pipefail
cd "$(dirname "$0")/.."

export MAPWELD_UPLOADS=${1:-2000}
# one after the other: each wants the machine for itself
cargo test --locked --release --test service -- --test-threads 1 --nocapture \
  uploads_a_second livez_answers above_its_capacity
