#!/usr/bin/env bash
# A robot needs a small binary and a library user no runtime: checks what each feature set depends on, and that it builds.
set -euo pipefail
cd "$(dirname "$0")/.."

absent() { # absent FLAGS NAME... : none of the crates NAME is a normal dependency under FLAGS
  local flags=$1 tree
  shift
  # shellcheck disable=SC2086
  tree=$(cargo tree --locked $flags -e normal --prefix none)
  for name in "$@"; do
    if grep -q "^$name v" <<<"$tree"; then
      echo "cargo tree $flags names $name, and must not" >&2
      return 1
    fi
    echo "cargo tree $flags: no $name"
  done
}

absent "" opentelemetry opentelemetry-otlp tracing-opentelemetry
absent "--no-default-features" tokio axum sqlx plotters
absent "--no-default-features --features client" axum sqlx plotters
# The check itself must be able to fail: the default features do name all three.
if absent "--all-features" axum >/dev/null 2>&1; then
  echo "the feature check sees no axum in the default features: it is broken" >&2
  exit 1
fi

for flags in "--no-default-features" "--no-default-features --features client" "--no-default-features --features server" \
  "--no-default-features --features experiments"; do
  echo "cargo check $flags"
  # shellcheck disable=SC2086
  cargo check --locked --quiet $flags
done
