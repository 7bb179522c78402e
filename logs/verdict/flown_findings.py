"""All findings of a flown track, rule by rule, in the verdict's order."""

from logs.verdict.findings import Finding
from logs.verdict.judge_geometry import unflyable_items
from logs.verdict.measures.route_demands import RouteDemands
from logs.verdict.measures.track_alignment import AlignedTrack
from logs.verdict.rules.bounds_rule import bounds_findings
from logs.verdict.rules.clearance_rule import clearance_findings
from logs.verdict.rules.completion_rule import completion_findings
from logs.verdict.rules.corridor_rule import corridor_findings
from logs.verdict.rules.departure_rule import departure_findings
from logs.verdict.rules.energy_rule import energy_findings
from logs.verdict.rules.fence_rule import fence_findings
from logs.verdict.rules.height_rule import height_findings
from logs.verdict.rules.loiter_rule import fold_loiters
from logs.verdict.rules.slope_rule import slope_findings
from logs.verdict.rules.speed_rule import speed_findings
from logs.verdict.rules.stall_rule import stall_findings
from logs.verdict.rules.takeoff_landing_rule import takeoff_landing_findings
from logs.verdict.rules.threat_rule import threat_findings
from logs.verdict.rules.turn_rule import turn_findings
from logs.verdict.rules.waypoint_rule import waypoint_findings


def flown_findings(
    demands: RouteDemands, aligned: AlignedTrack | None, ended: str, whole: bool, envelope: bool
) -> tuple[Finding, ...]:
    """Findings of a flight against its route and the aircraft's envelope, in the verdict's order."""
    findings = (
        *unflyable_items(demands.setup),
        *turn_findings(demands, aligned),
        *slope_findings(demands, aligned),
        *clearance_findings(demands, aligned),
        *height_findings(demands, aligned),
        *fence_findings(demands, aligned),
        *threat_findings(demands, aligned),
        *bounds_findings(demands, aligned),
        *waypoint_findings(demands, aligned),
        *corridor_findings(demands, aligned),
        *speed_findings(demands, aligned),
        *(stall_findings(demands, aligned) if envelope else ()),
        *takeoff_landing_findings(demands),
        *energy_findings(demands, aligned),
        *departure_findings(demands, aligned),
        *completion_findings(demands, aligned, ended, whole),
    )
    return fold_loiters(demands, aligned, findings)
