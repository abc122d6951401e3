#!/usr/bin/env bash
# Holds a served API against its own OpenAPI document with schemathesis: all checks, examples, edge cases, fuzzing and
# stateful runs; against a server that asks for no key, and against one that asks for keys.
#   tests/schemathesis.sh            some hundreds of cases each
#   tests/schemathesis.sh 20000      runs, each with another seed, until there were so many cases in all: the full proof
# MAPWELD_BIN names a program that is built already. Prints cases, failures and errors; exit code 1 when there was one.
set -euo pipefail
cd "$(dirname "$0")/.."

wanted=${1:-0}
version=4.32.5
tools=$PWD/target/tools/schemathesis
work=$(mktemp -d)
server=
finish() {
  [ -z "$server" ] || kill "$server" 2>/dev/null || true
  rm -rf "$work"
}
trap finish EXIT

if [ "$("$tools/bin/st" --version 2>/dev/null)" != "st, version $version" ]; then
  python3 -m venv "$tools"
  "$tools/bin/pip" install --quiet "schemathesis==$version"
fi
binary=${MAPWELD_BIN:-}
if [ -z "$binary" ]; then
  cargo build --locked --quiet
  binary=target/debug/mapweld
fi

start() { # start FOLDER OPTION... : a server on a free port; its URL in $url
  local folder=$1
  shift
  mkdir -p "$folder"
  # made here, not by the server's shell: that one may come later than the first look
  : >"$folder/out"
  "$binary" serve --listen 127.0.0.1:0 --data "$folder" --key-rate 0 --job-deadline 2s --max-queued 1000000 \
    --max-queued-per-session 1000000 --log warn "$@" >"$folder/out" 2>"$folder/log" &
  server=$!
  for _ in $(seq 100); do
    url=$(sed -n 's/^listening on //p' "$folder/out")
    [ -z "$url" ] || return 0
    sleep 0.1
  done
  cat "$folder/log" >&2
  return 1
}

stop() {
  kill "$server"
  wait "$server" || true
  server=
}

cases=0 failed=0
number() { python3 -c 'import json, sys; d = json.load(open(sys.argv[1])); print(eval(sys.argv[2], {}, {"d": d}))' "$work/report.json" "$1"; }

# run NAME SEED OPTION... : one run against $url
run() {
  local name=$1 seed=$2 code=0
  shift 2
  "$tools/bin/st" --config-file tests/schemathesis/schemathesis.toml run "$url/openapi.json" --no-color --checks all \
    --seed "$seed" --max-examples "$examples" --generation-database none --continue-on-failure \
    --report json --report-json-path "$work/report.json" "$@" >"$work/output" 2>&1 || code=$?
  local generated
  generated=$(number 'd["test_cases"]["generated"]')
  cases=$((cases + generated))
  echo "schemathesis $name, seed $seed: $generated cases, $(number 'd["test_cases"]["with_failures"]') with failures," \
    "$(number 'sum(e["count"] for e in d["errors"])') errors, $(number 'd["operations"]["tested"]') operations"
  if [ $code != 0 ]; then
    failed=1
    sed -n '/= FAILURES =/,$p; /= ERRORS =/,$p' "$work/output" | head -n "${SCHEMATHESIS_LINES:-400}" >&2
  fi
  if grep -q 'request failed\|panicked' "$work"/*/log; then
    failed=1
    echo "the server's log tells of failures:" >&2
    grep 'request failed\|panicked' "$work"/*/log | head -n 20 >&2
  fi
}

if [ "$wanted" -gt 0 ]; then examples=50; else examples=5; fi
seed=1
while :; do
  # Nobody has made a key: nobody needs one, so there is none to make up and none to ignore.
  start "$work/open-$seed"
  run "without keys" "$seed" --exclude-checks ignored_auth --generation-with-security-parameters false
  stop
  # With the key of an administrator, and held to asking for it.
  start "$work/keyed-$seed"
  key=$("$binary" keys create --scope admin --data "$work/keyed-$seed" | tail -n 1)
  run "with a key" "$seed" --header "Authorization: Bearer $key"
  stop
  [ "$cases" -lt "$wanted" ] || break
  seed=$((seed + 1))
done
echo "schemathesis: $cases cases in all, $([ $failed = 0 ] && echo "0 server errors, 0 schema violations" || echo FAILED)"
exit $failed
