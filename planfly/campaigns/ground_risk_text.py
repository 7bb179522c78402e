"""Describe the ground risk of a mission in lines, and in a table for an application."""

from logs.verdict.conditions import flown_condition_lines
from logs.verdict.returns.judge_returns import engine_out_world, make_return_world, rtl_autopilot_title
from logs.verdict.returns.returns_text import return_law_lines
from planfly.campaigns.find_ground_risk import GroundRiskResult
from planfly.campaigns.sora import IGRC_COLUMNS
from world.population import DENSITY_LIMITS_PER_KM2, Population, density_band, format_density
from world.wording import count_text

# Explanation of the table for an application.
TABLE_EXPLANATION = (
    "The larger value of each pair applies: the operational volume contains the flown contingency volume and the volume"
    " by formula, and the ground risk buffer contains the simulated falls and the width by formula. Formulas:"
    " SORA 2.5, Annex A, with the values of the guides of LBA and FOCA. Class: SORA 2.5, main body, table 2."
)
# Statement of what the result is not.
DISCLAIMER = (
    "This is a computation, not an approval: the authority decides on the population data, the volumes and the class."
    " It contains no mitigations, no final ground risk class and no air risk class, and it considers no airspace except"
    " the zones that were given."
)


def answer_line(result: GroundRiskResult) -> str:
    """Return the ground risk class in one line."""
    if not result.is_judged:
        return f"class not judged: {_unknown_reason(result)}"
    ground_text = "a controlled ground area" if result.goal.controlled else density_text(result.population)
    aircraft_text = f"{result.aircraft.wing_span:g} m span, {result.speed:g} m/s, {ground_text}"
    if result.ground_class is None:
        return f"not part of SORA: {aircraft_text} (main body, table 2)"
    return f"intrinsic ground risk class {result.ground_class}: {aircraft_text}"


def density_text(population: Population | None) -> str:
    """Return the highest population density of the footprint as text; None gives "population unknown"."""
    return "population unknown" if population is None else f"at most {format_density(population.max_density)}"


def _unknown_reason(result: GroundRiskResult) -> str:
    """Return the reason why the class of a result is not judged; the result must not be judged."""
    if result.base.mission.home is None:
        return "the mission has no home, so its returns, which enlarge the volumes, were not simulated"
    if result.population is None:
        return "no population raster was named (--population)"
    known_fraction = result.population.known_fraction
    fraction_text = "over 99.9%" if known_fraction > 0.999 else f"{known_fraction:.1%}"
    return (
        f"{result.population.source} has data for only {fraction_text} of the footprint's cells"
        f" ({density_text(result.population)} there)"
    )


def risk_lines(result: GroundRiskResult) -> list[str]:
    """Return the lines below the answer: volumes, population, zones, flights, and limits of the result."""
    flown, formula = result.flown, result.formula
    glide_text = (
        ""
        if result.glide_buffer is None or result.glide_ratio is None
        else f"; a glide of {result.glide_ratio:.1f} : 1 requires {result.glide_buffer:.0f} m"
    )
    lines = [
        f"flight geography: {result.half_width:.0f} m to either side of the path, up to {flown.height:.0f} m above"
        f" ground ({_share_text(result)} stay inside)",
        f"contingency volume: flights and the turns of returns reach {flown.contingency_width:.0f} m beyond the flight"
        f" geography and {flown.contingency_height:.0f} m above ground. Annex A requires a width of"
        f" {formula.width:.0f} m and a height of {formula.height:.0f} m. After their turns, returns reach"
        f" {flown.return_distance:.0f} m beyond the flight geography",
        f"ground risk buffer: falls{' and glides' if result.goal.glide else ''} reach {flown.buffer_width:.0f} m"
        f" beyond flights and returns. The 1:1 rule requires a width of {result.one_to_one_buffer:.0f}"
        f" m{glide_text}",
        f"areas: operational volume {result.volume.area / 1e6:.2f} km², operational volume and ground risk buffer"
        f" {result.footprint.area / 1e6:.2f} km²",
    ]
    if result.population is not None:
        population = result.population
        lat, lon = population.max_position
        population_line = (
            f"population: {density_text(population)}, at {lat:.5f}, {lon:.5f};"
            f" mean {format_density(population.mean_density)}"
            f" (cells of {population.cell_size:.0f} m of {population.source})"
        )
        lines.append(population_line)
    if result.entered_zones:
        lines.append(f"zones below or in the operational volume: {', '.join(result.entered_zones)}")
    lines += _flight_lines(result)
    return [*lines, DISCLAIMER]


def _share_text(result: GroundRiskResult) -> str:
    """Return a text on the fraction of the flights that stay in the flight geography."""
    return f"{result.goal.probability:.0%} of {count_text(len(result.rows), 'flight')}"


def _flight_lines(result: GroundRiskResult) -> list[str]:
    """Return the lines on the flights: their number, incomplete flights, speed, returns and glides."""
    lines = []
    if result.lost:
        lines.append(f"{result.lost} of {result.goal.flights} flights could not be simulated and are left out")
    endings = [row.ended for row in result.rows if row.ended != "completed"]
    if endings:
        most_frequent = max(set(endings), key=endings.count)
        lines.append(
            f"{len(endings)} of {len(result.rows)} flights do not complete the mission; most frequent reason:"
            f" {most_frequent}. The volumes contain these flights up to their end"
        )
    ground_speed = max(row.ground_speed for row in result.rows)
    if ground_speed > result.speed:
        lines.append(
            f"flights reach a ground speed of {ground_speed:.1f} m/s, but the formulas use a highest speed of only"
            f" {result.speed:g} m/s (--max-speed changes this speed)"
        )
    spread = result.base.dispersions.name
    setup = result.base.nominal_setup()
    returns_text = (
        f"; a return to launch by {rtl_autopilot_title(setup)}'s rules starts every {result.goal.interval:g} s"
    )
    if setup.mission.home is None:
        returns_text = ", without returns to launch"
    lines.append(f"{count_text(len(result.rows), 'flight')} with {spread}, seed {result.base.seed}{returns_text}")
    if result.goal.glide and setup.mission.home is not None:
        world = make_return_world(setup)
        if engine_out_world(world) is not world:
            lines.append(
                f"engine-out glides follow ArduPlane's rules, because {world.autopilot.title}'s are not simulated"
            )
    return [*lines, *return_law_lines(setup)[1:]]


def table_text(result: GroundRiskResult) -> str:
    """Return the table for an application, as Markdown."""
    table = "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in row)} |" for row in table_rows(result))
    conditions = "\n".join(
        f"- {line}" for line in (*flown_condition_lines(result.base.conditions()), *_flight_lines(result))
    )
    return (
        f"# Ground risk of {result.base.name}\n\n{answer_line(result)}\n\n"
        f"| quantity | value | source |\n|---|---|---|\n{table}\n\n"
        f"{TABLE_EXPLANATION}\n\n"
        f"## Flights\n\n{conditions}\n\n## What this is not\n\n{DISCLAIMER}\n"
    )


def table_rows(result: GroundRiskResult) -> list[tuple[str, str, str]]:
    """Return the rows of the table for an application: quantity, value and source.

    Cells in bold begin with "**".
    """
    flown, formula, goal = result.flown, result.formula, result.goal
    span = result.aircraft.wing_span
    share_text = _share_text(result)
    return [
        ("**aircraft**", "", ""),
        ("aircraft", result.aircraft.title, ""),
        ("characteristic dimension CD", f"{span:g} m", "wing span"),
        ("highest speed v", f"{result.speed:g} m/s", "stated" if goal.speed else "highest airspeed of the model"),
        ("take-off mass", f"{result.aircraft.mass:g} kg", ""),
        ("**flight geography**", "", ""),
        ("half width", f"{result.half_width:.1f} m", f"{share_text}: {flown.deviation:.1f} m; at least 1.5 CD"),
        ("height H_FG above ground", f"{flown.height:.1f} m", share_text),
        ("**contingency volume**", "", ""),
        (
            "flown width",
            f"{flown.contingency_width:.1f} m",
            "all flights and the turns of their returns, beyond flight geography",
        ),
        (
            "width S_CV by formula",
            f"{formula.width:.1f} m",
            f"S_GPS + S_Pos + S_K + S_RZ + S_CM = {formula.width_terms} m; S_CM = v²/(g tan 30°), a turn by 180°",
        ),
        ("**width along the whole flight geography**", f"**{result.contingency_width:.1f} m**", "the larger one"),
        (
            "for comparison: reach of returns",
            f"{flown.return_distance:.1f} m",
            "beyond flight geography; the operational volume also contains the areas below all returns",
        ),
        ("flown height above ground", f"{flown.contingency_height:.1f} m", "all flights and their returns"),
        (
            "height H_CV by formula",
            f"{formula.height:.1f} m",
            f"H_FG + H_baro + H_RZ + H_CM = {formula.height_terms} m; H_CM = 0.3 v²/g",
        ),
        ("**height of the operational volume**", f"**{result.volume_height:.1f} m**", "the larger one"),
        ("**ground risk buffer**", "", ""),
        (
            "flown width",
            f"{flown.buffer_width:.1f} m",
            f"falls from all flights and returns{', and glides' if goal.glide else ''}, with the wind",
        ),
        ("width by the 1:1 rule", f"{result.one_to_one_buffer:.1f} m", "H + CD/2"),
        *(
            [("width by a glide", f"{result.glide_buffer:.1f} m", f"E H, E = {result.glide_ratio:.1f}")]
            if result.glide_buffer is not None
            else []
        ),
        (
            "for comparison: ballistic",
            f"{result.ballistic_buffer:.1f} m",
            "v √(2 H/g) + CD/2, accepted for rotorcraft only",
        ),
        ("**width around the operational volume**", f"**{result.buffer_width:.1f} m**", "the largest one"),
        ("**areas**", "", ""),
        ("operational volume", f"{result.volume.area / 1e6:.3f} km²", ""),
        ("with ground risk buffer (footprint)", f"{result.footprint.area / 1e6:.3f} km²", ""),
        *_class_rows(result),
        ("**airspace**", "", ""),
        (
            "zones that overlap the operational volume",
            ", ".join(result.entered_zones) or "none of the given zones",
            f"{count_text(len(result.base.scenario.zones), 'zone')} given, compared without their heights",
        ),
    ]


def _class_rows(result: GroundRiskResult) -> list[tuple[str, str, str]]:
    """Return the last rows of the table.

    They are population, row and column of SORA's table, and ground risk class.
    """
    rows = [("**intrinsic ground risk class**", "", "")]
    population = result.population
    if population is not None:
        lat, lon = population.max_position
        rows += [
            (
                "highest population density",
                format_density(population.max_density),
                f"cell at {lat:.5f}, {lon:.5f}, of all cells that the footprint touches",
            ),
            ("mean population density", format_density(population.mean_density), "mean of these cells"),
            (
                "population raster",
                population.source,
                f"cells of {population.cell_size:.0f} m; data for {population.known_fraction:.1%} of the footprint",
            ),
        ]
    if not result.is_judged:
        return [*rows, ("class", "not judged", _unknown_reason(result))]
    class_text = "not part of SORA" if result.ground_class is None else str(result.ground_class)
    row = "controlled ground area"
    if not result.goal.controlled and result.population is not None:
        limits = [*(f"below {limit:,.0f}" for limit in DENSITY_LIMITS_PER_KM2), "from 50,000"]
        row = f"{limits[density_band(result.population.max_density)]} people/km²"
    column = next(
        (
            f"up to {widest:g} m and {fastest:g} m/s"
            for widest, fastest in IGRC_COLUMNS
            if result.aircraft.wing_span <= widest and result.speed <= fastest
        ),
        "beyond the last column",
    )
    return [*rows, ("**class**", f"**{class_text}**", f"{row}; {column}")]
