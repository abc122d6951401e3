#!/usr/bin/env bash
# Fuzzes everything that reads bytes of strangers, guided by coverage (libFuzzer), from a small corpus that it makes:
#   tests/fuzz.sh                 10 seconds a target, built in a hurry
#   tests/fuzz.sh 600             600 seconds a target: the full proof; from a minute on, with the address sanitizer, but
#                                 for whole uploads: the server behind them takes half an hour to build with it
#   tests/fuzz.sh 600 png pgm     only these targets
# Among all tests runs tests/readers.rs: the same readers, mutations without guidance.
# Prints one line a target: runs, seconds, crashes. Exit code 1 when there was a crash; what causes it stays in
# fuzz/artifacts/TARGET. Works on a stable toolchain: RUSTC_BOOTSTRAP lets it take the flags of the instrumentation.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${1:-10}
shift || true
targets=("$@")
[ ${#targets[@]} -gt 0 ] || targets=(yaml png pgm occupancy_grid multipart)

version=0.13.2
tools=$PWD/target/tools
export PATH="$tools/bin:$PATH"
if [ "$(cargo-fuzz --version 2>/dev/null)" != "cargo-fuzz $version" ]; then
  cargo install cargo-fuzz --locked --version "$version" --root "$tools" --quiet
fi

export RUSTC_BOOTSTRAP=1
corpus=fuzz/corpus
cargo run --quiet --locked --manifest-path fuzz/Cargo.toml --bin seeds -- "$corpus"

failed=0
for target in "${targets[@]}"; do
  log=$(mktemp)
  # a single input that takes 10 s or 1 GB is a find, too
  build=(--dev --sanitizer none)
  if [ "$target" = multipart ]; then
    build+=(--features server)
  elif [ "$seconds" -ge 60 ]; then
    build=(--sanitizer address)
  fi
  if cargo fuzz run "${build[@]}" "$target" "$corpus/$target" -- \
    -max_total_time="$seconds" -timeout=10 -rss_limit_mb=1024 -max_len=65536 -print_final_stats=1 >"$log" 2>&1; then
    crashes=0
  else
    crashes=1 failed=1
    tail -n 40 "$log" >&2
  fi
  runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
  covered=$(sed -n 's/.* cov: \([0-9]*\).*/\1/p' "$log" | tail -n 1)
  echo "fuzz $target: ${runs:-0} runs in $seconds s, ${covered:-0} edges covered, $crashes crashes"
  rm -f "$log"
done
exit $failed
