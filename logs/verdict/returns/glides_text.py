"""Describe glides after an engine failure in words."""

import math

from flight.autopilots.simulated_returns import ENGINE_FAILURE_REACTION_S
from logs.verdict.returns.judge_glides import (
    GLIDE_CLEARANCE_M,
    REACHES,
    GlideRange,
    Glides,
    GlideSite,
    NotJudged,
    Reach,
)
from world.wording import count_text

_NOT_JUDGED_TEXTS: dict[NotJudged, str] = {
    "terrain": "there is no elevation file",
    "trim": "the model has no trim with the throttle closed",
    "far": "the route is too long for a map of its surroundings",
}
_COUNT_TEXTS: dict[Reach, str] = {
    "home": "home can be reached from {count}",
    "site": "a rally point or landing place, but not home, from {count}",
    "flat": "only flat ground from {count}",
    "nothing": "nothing from {count}",
    "unknown": "from {count} the reach is unknown",
}
_REACH_TEXTS: dict[Reach, str] = {
    "home": "home is in reach",
    "site": "a rally point or landing place is in reach",
    "flat": "only flat ground is in reach",
    "nothing": "nothing is in reach",
    "unknown": "the reach is unknown",
}


def reached_text(reach: Reach) -> str:
    """Describe which kind of destination is in reach after an engine failure.

    >>> reached_text("home")
    'home is in reach'
    """
    return _REACH_TEXTS[reach]


def glides_headline(glides: Glides) -> str:
    """Return a line on the destinations in reach after an engine failure, or on why they are not judged.

    >>> glides_headline(Glides((), (), 18.0, not_judged="terrain"))
    'not judged: there is no elevation file'
    """
    if glides.not_judged:
        return f"not judged: {_NOT_JUDGED_TEXTS[glides.not_judged]}"
    if not glides.each:
        return "no position to glide from"
    counts = [(reach, glides.count(reach)) for reach in REACHES]
    # Home is reported even if it is reached from nowhere.
    home_text, *other_texts = (
        _COUNT_TEXTS[reach].format(count=count) for reach, count in counts if count or reach == "home"
    )
    reach_text = "; ".join([f"{home_text} of {count_text(len(glides.each), 'position')}", *other_texts])
    if any(glide.own_return.end == "not flown" for glide in glides.each):
        follows_text = ", which would follow the terrain," if glides.follows_terrain else " without the engine"
        own_text = f"{glides.autopilot}'s own return{follows_text} is not simulated"
    else:
        own_text = f"{glides.autopilot}'s own return arrives over its target from {glides.arrival_count}"
        if glides.unexpected_arrival_count:
            search_text = "where the search, which is pessimistic, does not reach its target"
            own_text += f" ({glides.unexpected_arrival_count} of them {search_text})"
    return f"{reach_text}; {own_text}"


def site_text(site: GlideSite) -> str:
    """Return the name of a glide site.

    >>> site_text(GlideSite("rally", 2, 0.0, 0.0)), site_text(GlideSite("landing", 9, 0.0, 0.0))
    ('rally point 2', 'the landing at item 9')
    """
    match site.kind:
        case "home":
            return "home"
        case "rally":
            return f"rally point {site.number}"
        case "landing":
            return f"the landing at item {site.number}"


def glide_range_text(glide_range: GlideRange, glides: Glides) -> str:
    """Describe a time range of engine failures: best destination, spare altitude and the autopilot's RTL."""
    glide, altitude_left = glide_range.lowest_glide, glides.altitude_left(glide_range.lowest_glide)
    time_text, worst_text = f"{glide_range.first:.0f} s", ""
    if glide_range.count > 1:
        time_text = f"{glide_range.first:.0f} to {glide_range.last:.0f} s"
        worst_text = f" (worst case: failure at {glide.time:.0f} s)"
    match glide.reach:
        case "home" | "site":
            site = site_text(glides.sites[glide_range.site])
            reach_text = f"{site} is in reach with {altitude_left:.0f} m of altitude to spare{worst_text}"
        case "flat":
            east, north, up = glide.flat_position
            reach_text = (
                f"only flat ground is in reach, for example at {east:.0f} m east, {north:.0f} m north, {up:.0f} m AMSL,"
                f" with {altitude_left:.0f} m of altitude to spare{worst_text}"
            )
        case "nothing" if math.isinf(altitude_left):
            reach_text = "nothing is in reach: no glide path exists"
        case "nothing":
            reach_text = f"nothing is in reach: at most {-altitude_left:.0f} m of altitude are missing"
        case "unknown":
            reach_text = "unknown, because this part lies outside the elevation data"
    own_return, name = glide.own_return, glide.own_return.target.name
    match own_return.end:
        case "arrives":
            end_text = f"arrives over {name}"
        case "low":
            min_height = min(own_return.arrival_height, own_return.clearance)
            height_text = f"{min_height:.0f} m above ground on its way to {name}"
            end_text = f"descends to {height_text}, below the required {GLIDE_CLEARANCE_M:.0f} m"
        case "ground":
            shortfall = own_return.shortfall
            distance_text = f"{shortfall / 1000.0:.1f} km" if shortfall >= 1000.0 else f"{shortfall:.0f} m"
            end_text = f"comes down {distance_text} from {name}"
        case "threat":
            end_text = "enters a missile's sphere"
        case "unknown":
            end_text = "leaves the elevation data"
        case "not flown":
            end_text = ""
    own_text = f"; {glides.autopilot}'s own return {end_text}" if end_text else ""
    return f"engine failure at {time_text}: {reach_text}{own_text}"


def glide_notes(glides: Glides) -> list[str]:
    """Return notes on the assumptions under which glides were flown; [] if there are no glides."""
    if not glides.each:
        return []
    notes = [
        f"a glide begins {ENGINE_FAILURE_REACTION_S:.0f} s after the engine failure, at "
        f"{glides.airspeed_name} {glides.airspeed:g} m/s; it stays at least {GLIDE_CLEARANCE_M:.0f} m above ground and"
        " outside missiles' spheres, but may cross zones",
        "flat ground is found in the elevation file, which contains no trees, houses or water",
    ]
    if glides.unexpected_arrival_count:
        notes.append(
            f"the best glide is searched on a map of {glides.cell:.0f} m cells, each as high as its highest ground, and"
            f" without the height that excess airspeed gives; {glides.autopilot}'s own return is simulated over the"
            " ground itself and with this height, so it also arrives from some positions from which the search does not"
            " reach its target"
        )
    if glides.fuel:
        notes.append("glides are flown with the throttle closed, because the drag of a stopped engine is unknown")
    return notes
