"""Count the flights of a campaign or of a search by failed rule and place, and write the counts."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from logs.verdict.places import Place, numbered_place
from logs.verdict.rule_words import RULE_WORDS
from logs.verdict.wording import place_text
from world.wording import count_text


@dataclass(frozen=True)
class RuleFailures:
    """Numbers of flights that failed a rule, in total and at each place.

    flights: number of flights that failed the rule anywhere.
    places: each place with its number of flights, the most frequent first; a flight may fail at several places.
    """

    rule: str
    flights: int
    places: tuple[tuple[Place, int], ...]


def count_failures(flights: Iterable[Iterable[tuple[str, Place]]]) -> tuple[RuleFailures, ...]:
    """Count flights by failed rule and place.

    The most urgent rules, which may cause other failures, come first.

    flights: failed rules and places of each flight.

    >>> [one.flights for one in count_failures([[("slope", Place("leg", 1)), ("slope", Place("leg", 2))], []])]
    [1]
    """
    counts: Counter[str] = Counter()
    places: dict[str, Counter[Place]] = {}
    # Flights fail at different corners of a loiter, which is one place; the first corner found stands for all.
    first_places: dict[Place, Place] = {}
    for flight in flights:
        failed_findings = list(flight)
        counts.update({rule for rule, _ in failed_findings})
        for rule, place in failed_findings:
            places.setdefault(rule, Counter())[first_places.setdefault(numbered_place(place), place)] += 1
    rules = sorted(counts, key=lambda rule: (-RULE_WORDS[rule].urgency, list(RULE_WORDS).index(rule)))
    return tuple(RuleFailures(rule, counts[rule], tuple(places[rule].most_common())) for rule in rules)


def deciding_rule(by_rule: Sequence[RuleFailures]) -> str:
    """Return the rule that fails the most flights, in a tie the most urgent; "" without failures.

    by_rule: failures by rule, the most urgent rule first.
    """
    return next(iter(deciding_rules(by_rule)), "")


def deciding_rules(by_rule: Sequence[RuleFailures]) -> tuple[str, ...]:
    """Return the rules that fail the most flights (ties included), most urgent first; () without failures.

    by_rule: failures by rule, the most urgent rule first.

    >>> flights = [[("slope", Place("leg", 1)), ("turn", Place("waypoint", 1))], [("clearance", Place("leg", 2))]]
    >>> deciding_rules(count_failures([*flights, *flights[1:]])), deciding_rules(count_failures(flights[:1]))
    (('clearance',), ('slope', 'turn'))
    """
    max_flights = max((failures.flights for failures in by_rule), default=0)
    return tuple(failures.rule for failures in by_rule if failures.flights == max_flights)


def failures_document(by_rule: Iterable[RuleFailures]) -> list[dict[str, Any]]:
    """Return the failures by rule and place as data for a JSON document."""
    return [
        {
            "rule": failures.rule,
            "flights": failures.flights,
            "places": [
                {"where": place_text(place), "flights": count, **asdict(place)} for place, count in failures.places
            ],
        }
        for failures in by_rule
    ]


def failure_lines(by_rule: Iterable[RuleFailures], mission_fault: str = "") -> list[str]:
    """Return a line for each failed rule: number of failed flights, and the three most frequent places.

    mission_fault: text for failures of the mission as a whole, which have no place; "" without one.
    by_rule: failures by rule and place.
    """
    lines = []
    for failures in by_rule:
        texts = [
            mission_fault
            if place.kind == "mission" and place.item is None
            else f"{place_text(place)} in {count_text(count, 'flight')}"
            for place, count in failures.places[:3]
        ]
        places_text = ", ".join(filter(None, texts))
        line = f"  failed  {RULE_WORDS[failures.rule].title} in {count_text(failures.flights, 'flight')}"
        lines.append(f"{line}: {places_text}" if places_text else line)
    return lines
