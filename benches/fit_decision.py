#!/usr/bin/env python3
"""Fit the weights of the decision of the method hough, and measure it in buildings that it was not fitted to.

    fit_decision.py MAPWELD PAIRS.json [PAIRS.json ...] [--parts 10] [--penalty 1] [--evaluate-only SOURCE ...]

MAPWELD     the program, built with --release
PAIRS.json  labelled pairs, as `mapweld evaluate --pairs` and `mapweld simulate` have them: `id`, `source`, `building`
            ("A|B" for maps of two), `fixed`, `moving`, `match`, `truth`, `overlap`, `moments` of the moving map's
            occupied cells (`mean_x`, `mean_y`, `mean_r2`) and `tolerance` in metres

Each hypothesis that the search looked at closely is a sample: right when the moving map's occupied cells lie within the
pair's tolerance of the truth (RMS). The weights are those of penalised logistic regression: of the terms in their own
spread, penalty / 2 times the square of each weight but the constant's. Sources named by --evaluate-only (bent maps, which
have a rule of their own) are not fitted to.

The buildings are dealt out in parts. Prints figures for each source of each list, of pairs that MAPWELD itself decided
with weights fitted to the pairs that have no building of the same parts; and the weights fitted to everything, as
`--parameters` takes them. Standard library only.
"""
import argparse
import json
import math
import os
import random
import subprocess
import sys
import tempfile
from collections import defaultdict

STEPS = 60


def error(pose, truth, moments):
    """RMS distance in metres between where two poses put the moving map's occupied cells."""
    turn = pose["yaw"] - truth["yaw"]
    cos = math.cos(pose["yaw"]) - math.cos(truth["yaw"])
    sin = math.sin(pose["yaw"]) - math.sin(truth["yaw"])
    x, y = moments["mean_x"], moments["mean_y"]
    dx, dy = pose["x"] - truth["x"], pose["y"] - truth["y"]
    moved = dx * (cos * x - sin * y) + dy * (sin * x + cos * y)
    square = 4 * math.sin(turn / 2) ** 2 * moments["mean_r2"] + 2 * moved + dx * dx + dy * dy
    return math.sqrt(max(0.0, square))


def right(pair, pose):
    return pair["match"] and error(pose, pair["truth"], pair["moments"]) <= pair["tolerance"]


def solve(matrix, vector):
    """Gauss's elimination with pivots."""
    n = len(vector)
    rows = [row[:] + [value] for row, value in zip(matrix, vector)]
    for i in range(n):
        best = max(range(i, n), key=lambda k: abs(rows[k][i]))
        rows[i], rows[best] = rows[best], rows[i]
        for k in range(n):
            if k != i and rows[k][i]:
                part = rows[k][i] / rows[i][i]
                rows[k] = [a - part * b for a, b in zip(rows[k], rows[i])]
    return [rows[i][n] / rows[i][i] for i in range(n)]


def fit(samples, penalty):
    """Weights of the terms, the first of which is the constant, by Newton's method. A sample is (terms, right)."""
    n, count = len(samples[0][0]), len(samples)
    mean = [0.0] + [sum(x[i] for x, _ in samples) / count for i in range(1, n)]
    spread = [1.0] + [
        math.sqrt(sum((x[i] - mean[i]) ** 2 for x, _ in samples) / count) or 1.0 for i in range(1, n)
    ]
    scaled = [([(a - m) / s for a, m, s in zip(x, mean, spread)], y) for x, y in samples]
    weights = [0.0] * n
    for _ in range(STEPS):
        gradient = [0.0] + [penalty * w for w in weights[1:]]
        curvature = [[penalty if i == j and i else 0.0 for j in range(n)] for i in range(n)]
        for x, y in scaled:
            logit = sum(a * w for a, w in zip(x, weights))
            p = 1 / (1 + math.exp(-min(40.0, max(-40.0, logit))))
            off, bend = p - y, p * (1 - p) + 1e-12
            for i, a in enumerate(x):
                gradient[i] += off * a
                row, part = curvature[i], bend * a
                for j in range(i + 1):
                    row[j] += part * x[j]
        for i in range(n):
            for j in range(i):
                curvature[j][i] = curvature[i][j]
        step = solve(curvature, gradient)
        weights = [w - s for w, s in zip(weights, step)]
        if max(map(abs, step)) < 1e-7:
            break
    else:
        sys.exit("the weights did not settle: is there a right and a wrong hypothesis in the lists?")
    plain = [w / s for w, s in zip(weights, spread)]
    plain[0] -= sum(w * m for w, m in zip(plain[1:], mean[1:]))
    return plain


class Mapweld:
    def __init__(self, program, folder):
        self.program, self.folder = program, folder

    def evaluate(self, pairs, *options):
        path = os.path.join(self.folder, "pairs.json")
        with open(path, "w", encoding="utf-8") as file:
            json.dump(pairs, file)
        run = subprocess.run(
            [self.program, "evaluate", "--pairs", path, *options], check=True, stdout=subprocess.PIPE, text=True
        )
        return {answer["id"]: answer for answer in map(json.loads, run.stdout.splitlines())}

    def hypotheses(self, pairs):
        path = os.path.join(self.folder, "hypotheses.jsonl")
        self.evaluate(pairs, "--hypotheses", path)
        with open(path, encoding="utf-8") as file:
            return {line["id"]: line["hypotheses"] for line in map(json.loads, file)}


def figures(pairs, answers):
    high, low, wrong, false, others = [0, 0], [0, 0], 0, 0, 0
    for pair in pairs:
        answer = answers[pair["id"]]
        if not pair["match"]:
            others += 1
            false += answer["merged"]
            continue
        good = answer["merged"] and right(pair, answer)
        wrong += answer["merged"] and not good
        group = high if pair["overlap"] >= 0.3 else low
        group[0] += good
        group[1] += 1
    return (
        f"right {high[0]} of {high[1]} at overlap 0.3 or more, {low[0]} of {low[1]} below; "
        f"wrong {wrong}, false {false} of {others}"
    )


def buildings(pair):
    return pair["building"].split("|")


def parts_of(pairs, parts):
    """The part of each building; the buildings of most pairs are dealt out first."""
    count = defaultdict(int)
    for pair in pairs:
        for building in buildings(pair):
            count[building] += 1
    order = sorted(count)
    random.Random(1).shuffle(order)
    load, part = [0] * min(parts, len(order)), {}
    for building in sorted(order, key=lambda name: -count[name]):
        part[building] = load.index(min(load))
        load[part[building]] += count[building]
    return part


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mapweld")
    parser.add_argument("lists", nargs="+", metavar="PAIRS.json")
    parser.add_argument("--parts", type=int, default=10)
    parser.add_argument("--penalty", type=float, default=1.0)
    parser.add_argument("--evaluate-only", nargs="*", default=[], metavar="SOURCE")
    options = parser.parse_args()

    pairs = []
    for path in options.lists:
        with open(path, encoding="utf-8") as file:
            for pair in json.load(file):
                pair["list"] = path
                for name in ("fixed", "moving"):
                    pair[name] = os.path.join(os.path.abspath(os.path.dirname(path)), pair[name])
                pairs.append(pair)
    if len({pair["id"] for pair in pairs}) < len(pairs):
        sys.exit("two pairs have one id")

    with tempfile.TemporaryDirectory() as folder:
        mapweld = Mapweld(options.mapweld, folder)
        found = mapweld.hypotheses(pairs)
        names = list(next(terms for all in found.values() for terms in (h["terms"] for h in all)))

        def weights(chosen):
            samples = [
                ([hypothesis["terms"][name] for name in names], float(right(pair, hypothesis["pose"])))
                for pair in chosen
                if pair["source"] not in options.evaluate_only
                for hypothesis in found[pair["id"]]
            ]
            if len({y for _, y in samples}) < 2:
                sys.exit("there is no right or no wrong hypothesis outside of a part: fewer parts, or more pairs")
            fitted = {name: round(w, 4) for name, w in zip(names, fit(samples, options.penalty))}
            return json.dumps({"decision": {"weights": fitted}})

        part = parts_of(pairs, options.parts)
        # a pair of two buildings is judged by weights that were fitted to neither
        judged = defaultdict(list)
        for pair in pairs:
            judged[frozenset(part[building] for building in buildings(pair))].append(pair)
        answers = {}
        for number, (left_out, chosen) in enumerate(judged.items(), 1):
            others = [pair for pair in pairs if left_out.isdisjoint(part[building] for building in buildings(pair))]
            answers |= mapweld.evaluate(chosen, "--parameters", weights(others))
            print(f"{number} of {len(judged)} fits: {figures(chosen, answers)}", file=sys.stderr, flush=True)
        for path in options.lists:
            sources = sorted({pair["source"] for pair in pairs if pair["list"] == path})
            for source in sources:
                chosen = [pair for pair in pairs if pair["list"] == path and pair["source"] == source]
                print(f"left out, {os.path.basename(path)}, {source}: {figures(chosen, answers)}")
        print(f"left out, all: {figures(pairs, answers)}")
        print(weights(pairs))


if __name__ == "__main__":
    main()
