"""Answers that each rule turns, as a table: right to wrong, wrong to right, McNemar's test, costs."""

from collections.abc import Mapping
from typing import Any

from scipy.stats import binomtest

from .rules import rules
from .work import answer_of

# Value of a right name, a wrong one, and of no name where there is nothing to name.
RIGHT, WRONG, SILENT = 1.0, -2.0, 1.0

# Rules that these cases cannot show to matter, and what they are for, by the beginning of their place.
KEPT_FOR: Mapping[str, str] = {
    "decision.doubts": "runs of one sine, too short, or with a size at its bound",
    "decision.findings": "figures of the report",
    "decision.harmful_effects": "recordings that some effects predict far worse",
    "decision.held_out_check": "recordings whose left-out runs disagree",
    "decision.probability": "stated probabilities, which are not scored here",
    "fit.encoder_zeros": "zeros that are degrees off",
    "fit.torque_alignment": "logs whose torque is late",
    "held_out.differing_runs": "runs with a load, offsets or friction of their own",
    "held_out.folds": "one or two runs, or many",
    "held_out.known_payload": "gains by a known mass",
    "held_out.recurring_push": "pushes that every run has",
    "proposals.flat_top": "drives that report what they gave",
    "plausibility.prominence.SECOND": "two faults at one joint, which no plant draws",
    "plausibility.prominence._is_no_rest": "two faults at one joint, which no plant draws",
}


def kept_for(place: str) -> str:
    """Purpose of a rule that these cases cannot show; empty for any other."""
    return next((why for start, why in KEPT_FOR.items() if place.startswith(start)), "")


def is_right(row: Mapping[str, Any]) -> bool:
    """Whether an answer has every fault and no wrong name; of a law in no catalogue, no name."""
    if row["wrong"] or row["verdict"] in ("crash", "refused"):
        return False
    return not row["named"] if row["kind"] in ("healthy", "unknown") else bool(row["all_named"])


def worth(row: Mapping[str, Any]) -> float:
    """Value of an answer."""
    named = RIGHT * sum(row["right"]) + WRONG * row["wrong"]
    silent = row["kind"] in ("healthy", "unknown") and not row["named"] and row["verdict"] != "crash"
    return float(named + SILENT * silent)


def mcnemar(lost: int, won: int) -> float:
    """McNemar's exact p: of so many cases that turn either way, as uneven a split by chance."""
    return float(binomtest(lost, lost + won).pvalue) if lost + won else 1.0


def tabulated(
    traces: Mapping[str, Mapping[str, Any]], runs: Mapping[str, Mapping[str, Mapping[str, Any]]]
) -> dict[str, Any]:
    """The table. traces: a row a case, with the rules that matter to it. runs: rows by rule and case."""
    lines = []
    for key, rule in rules().items():
        cases = [name for name, row in traces.items() if key in row["matter"]]
        again = {name: runs.get(key, {})[name] for name in cases if name in runs.get(key, {})}
        before = {name: traces[name] for name in again}
        lost = sum(is_right(before[name]) and not is_right(row) for name, row in again.items())
        won = sum(not is_right(before[name]) and is_right(row) for name, row in again.items())
        lines.append(
            {
                "place": rule.place,
                "value": rule.value,
                "off": rule.off,
                "matters": len(cases),
                "run": len(again),
                "changed": sum(answer_of(before[name]) != answer_of(row) for name, row in again.items()),
                "crashed": sum(row["verdict"] == "crash" for row in again.values()),
                "right_to_wrong": lost,
                "wrong_to_right": won,
                "p": mcnemar(lost, won),
                "worth": sum(worth(row) - worth(before[name]) for name, row in again.items()),
            }
        )
    return {
        "format": "rule-ablation",
        "cases": len(traces),
        "right": sum(map(is_right, traces.values())),
        "worth": sum(map(worth, traces.values())),
        "rules": lines,
    }


# What the table says of a rule.
MEANINGS: Mapping[str, str] = {
    "nothing": "neutralised one way, it turns no comparison that reaches an answer, in any case",
    "no answer": "it turns one, and no answer changes",
    "costs": "without it the answers are worth more",
    "open": "it may matter to cases that were not run again, or not all of them",
    "earns": "without it the answers are worth as much or less",
}


def verdicts(table: Mapping[str, Any]) -> dict[str, str]:
    """What each place earns, one of MEANINGS: the first that one of the ways to neutralise it has."""
    found: dict[str, str] = {}
    ranks = tuple(MEANINGS)
    for line in table["rules"]:
        if not line["matters"]:
            own = "nothing"
        elif line["run"] < line["matters"]:
            own = "open" if line["worth"] <= 0 else "costs"
        elif not line["changed"]:
            own = "no answer"
        else:
            own = "costs" if line["worth"] > 0 else "earns"
        found[line["place"]] = min(found.get(line["place"], own), own, key=ranks.index)
    return found


def page(table: Mapping[str, Any]) -> str:
    """The table in Markdown: rules by how many answers they change, then those that change none."""
    own = verdicts(table)
    counts = {name: sum(each == name for each in own.values()) for name in MEANINGS}
    lines = [
        "# What each rule earns",
        "",
        f"{table['cases']} robots, {table['right']} answered right, worth {table['worth']:g} in all.",
        "",
        "| rules | how many | meaning |",
        "| --- | --- | --- |",
        *(f"| {name} | {counts[name]} | {meaning} |" for name, meaning in MEANINGS.items()),
        "",
        "## Neutralised and run again",
        "",
        "| rule | is | without | may matter to | run | other answers | right → wrong | wrong → right | p "
        "| worth | the rule |",
        "| --- " * 11 + "|",
    ]
    order = sorted(table["rules"], key=lambda e: (-e["changed"], -e["run"], -e["matters"], e["place"]))
    for each in (line for line in order if line["run"]):
        cells = [
            f"`{each['place']}`",
            each["value"].replace("|", "or"),
            each["off"],
            *(each[name] for name in ("matters", "run", "changed", "right_to_wrong", "wrong_to_right")),
            f"{each['p']:.2g}",
            f"{each['worth']:+g}",
            own[each["place"]],
        ]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    for title, verdict in (("Never turned", "nothing"), ("Not run yet", "open")):
        lines += ["", f"## {title}", "", "| rule | kept for |", "| --- | --- |"]
        run = {each["place"] for each in table["rules"] if each["run"]}
        places = sorted(place for place, each in own.items() if each == verdict and place not in run)
        lines += [f"| `{place}` | {kept_for(place)} |" for place in places]
    return "\n".join(lines) + "\n"
