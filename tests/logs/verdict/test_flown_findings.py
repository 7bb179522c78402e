from logs.recording.example_log import example_log
from logs.verdict.findings import RULES
from logs.verdict.flown_findings import flown_findings
from logs.verdict.measures.route_demands import route_demands
from logs.verdict.measures.track_alignment import lay_track


def test_rules_come_in_the_verdicts_order() -> None:
    log = example_log()
    demands = route_demands(log.setup)
    findings = flown_findings(demands, lay_track(demands, log.track), "completed", True, True)
    order = list(RULES)
    assert [order.index(item.rule) for item in findings] == sorted(order.index(item.rule) for item in findings)


def test_without_the_envelope_nothing_is_said_of_the_stall() -> None:
    log = example_log()
    demands = route_demands(log.setup, envelope=False)
    findings = flown_findings(demands, lay_track(demands, log.track), "completed", True, False)
    assert not [item for item in findings if item.rule == "stall"]
