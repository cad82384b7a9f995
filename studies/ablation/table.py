"""What each rule turns, as a table: right to wrong, wrong to right, McNemar's test, costs."""

from collections.abc import Mapping
from typing import Any

from scipy.stats import binomtest

from .rules import rules
from .work import answer_of

# Value of a right name, a wrong one, and of no name where there is nothing to name.
RIGHT, WRONG, SILENT = 1.0, -2.0, 1.0


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


def verdicts(table: Mapping[str, Any]) -> dict[str, str]:
    """What each place earns, from the best of the ways to neutralise it.

    nothing: no comparison turned, in any case. no answer: one turned, and no answer did. open: not all cases
    were run. earns: it turns more right than wrong, or as many. costs: the reverse.
    """
    found: dict[str, str] = {}
    ranks = ("nothing", "no answer", "costs", "open", "earns")
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
    """The table in Markdown, a line a way to neutralise a rule, those that turn most first."""
    own = verdicts(table)
    counts = {name: sum(each == name for each in own.values()) for name in dict.fromkeys(own.values())}
    lines = [
        "# What each rule earns",
        "",
        f"{table['cases']} cases, {table['right']} answered right, worth {table['worth']:g} in all. "
        + ", ".join(f"{name}: {count} rules" for name, count in sorted(counts.items()))
        + ".",
        "",
        "| rule | is | without | may matter to | run | other answers | right → wrong | wrong → right "
        "| McNemar's p | worth | in all |",
        "| --- " * 11 + "|",
    ]
    order = sorted(table["rules"], key=lambda e: (-e["changed"], -e["run"], -e["matters"], e["place"]))
    for each in order:
        if each["matters"]:
            cells = [
                f"`{each['place']}`",
                each["value"],
                each["off"],
                *(each[name] for name in ("matters", "run", "changed", "right_to_wrong", "wrong_to_right")),
                f"{each['p']:.2g}",
                f"{each['worth']:+g}",
                own[each["place"]],
            ]
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    silent = sorted(place for place, verdict in own.items() if verdict == "nothing")
    lines += ["", "Neutralised one way at least, these turn no comparison in any case:", ""]
    lines += [f"`{place}`" + ("," if place != silent[-1] else "") for place in silent]
    return "\n".join(lines) + "\n"
