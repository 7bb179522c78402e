"""Kernels that each unit of work calls from Python, for the progress of a first start.

Kernels that other kernels call are compiled with them.  `tests/planfly/kernel_units` compares these lists with the
actual calls.
"""

# Kernels of terrain and map projection.
_FIELD = (
    "world.least_squares._solve_gram_schmidt",
    "world.frames._evaluate_polymap",
    "world.terrain._ground_heights",
)
# Kernel of the tracking error.
_TRACKING_KERNELS = ("flight.autopilots.arduplane.tracking_error._measure_corners",)
# Kernels of a scenario.
_WORLD_KERNELS = (*_FIELD, *_TRACKING_KERNELS)
# Kernel of the ranking of candidates.
_RANK_KERNELS = ("planner.optimisers.preference._rank_candidates",)
# Kernels of the arrays of a planning problem.
_ARRAY_KERNELS = (
    "world.terrain.steepest_slopes",
    "planner.airspace.zone_limits._reduce_margins",
    "planner.evaluation.threat_index._fill_cells",
    "planner.evaluation.threat_index._list_units",
)
# Kernels of a planning problem.
_PROBLEM_KERNELS = (*_WORLD_KERNELS, *_ARRAY_KERNELS)
# Prefixes of kernel names.
_CERTIFY_MODULE = "planner.evaluation.certify_kernels."
_SIDES = "planner.seeding.side_routes."
_LAYOUT = "logs.recording.mcap_writer."
_GLIDES_MODULE = "logs.verdict.returns."

# Kernels that each unit calls from Python, by name of the unit.
UNIT_KERNELS: dict[str, tuple[str, ...]] = {
    "problem": (*_FIELD, *_ARRAY_KERNELS),
    "tracking": _TRACKING_KERNELS,
    "ranks": _RANK_KERNELS,
    "scores": (
        *_PROBLEM_KERNELS,
        "planner.evaluation.graded_scores._score_paths",
        *_RANK_KERNELS,
        "planner.seeding.pattern_search._begin_search",
        "planner.seeding.pattern_search._continue_search",
    ),
    "certificates": (
        *_PROBLEM_KERNELS,
        "aircraft.path_limits.arc_slope",
        "aircraft.path_limits.turn_tangents",
        _CERTIFY_MODULE + "corner_excursions",
        _CERTIFY_MODULE + "heights_above_ground",
        _CERTIFY_MODULE + "leg_slope_limits",
        _CERTIFY_MODULE + "missile_distance",
        _CERTIFY_MODULE + "turn_and_roll_lengths",
        _CERTIFY_MODULE + "add_end_course_points",
        "planner.evaluation.corners.fly_by_radii",
        "planner.evaluation.corners.settling_length",
    ),
    "shortening": (
        *_PROBLEM_KERNELS,
        "planner.seeding.shortening.begin_shortening",
        "planner.seeding.shortening.continue_shortening",
    ),
    "routes": (
        *_PROBLEM_KERNELS,
        "planner.evaluation.leg_constraints.slope_limits",
        "planner.seeding.grids.begin_route",
        "planner.seeding.grids.continue_route",
        "planner.seeding.grids.extract_route",
        "planner.seeding.waypoint_fitting._choose_candidates",
    ),
    "sides": (
        *_PROBLEM_KERNELS,
        "planner.seeding.grids.find_obstacles",
        _SIDES + "begin_grid_costs",
        _SIDES + "cheapest_passings",
        _SIDES + "continue_grid_costs",
        _SIDES + "route_through",
    ),
    "fronts": (
        *_PROBLEM_KERNELS,
        "planner.evaluation.front_scores._fill_values",
        "planner.optimisers.hypervolume._mark_covered_probes",
        "planner.optimisers.hypervolume._choose_rows_greedily",
    ),
    "paper": (*_PROBLEM_KERNELS, "planner.evaluation.paper_scores._score_paths"),
    "flight": (
        *_WORLD_KERNELS,
        "aircraft.envelope.ground_slope",
        "aircraft.envelope.ground_speed",
        "aircraft.path_limits.aircraft_slopes",
        "aircraft.path_limits.arc_slope",
        "aircraft.path_limits.fly_over_run",
        "aircraft.path_limits.ground_speed_on",
        "aircraft.path_limits.true_airspeed",
        "aircraft.path_limits.turn_radius_between",
        "aircraft.tracking.density_factor",
        "flight.autopilots.arduplane.law.arduplane_loop",
        "flight.autopilots.arduplane.navigator.turn_distance",
        "flight.autopilots.arduplane.rtl_point_mass.fly_stages",
        "flight.autopilots.planfly.law.planfly_loop",
        "flight.dynamics.compiled_frame.initialise_attitude",
        "flight.dynamics.compiled_frame.step_repeatedly",
        "flight.guidance.equivalent_airspeed.eas_to_tas_ratio",
        "flight.guidance.path.profile_at",
        "flight.simulation.track._round_to_steps",
        _LAYOUT + "_copy_messages",
        _LAYOUT + "_index_messages",
        _LAYOUT + "_merge_by_time",
        _LAYOUT + "_write_message_header",
        _LAYOUT + "_stamp_messages",
        _LAYOUT + "last_log_time",
        "logs.verdict.measures.path_sweeps._path_clearances",
        "logs.verdict.measures.path_sweeps._sphere_visits",
        "logs.verdict.measures.route_progress._match_rows",
        "logs.verdict.measures.track_alignment._match_chords",
        "logs.verdict.measures.track_alignment.airspeed_gain_in_rising_air",
        "world.wind._mean_wind_speeds",
        "world.wind.mean_wind_speed",
    ),
    "glides": (
        *_WORLD_KERNELS,
        "aircraft.envelope.ground_speed",
        "flight.autopilots.arduplane.rtl_point_mass.fly_stages",
        _GLIDES_MODULE + "glide_map._fill_slopes",
        _GLIDES_MODULE + "glide_map._settle_cells",
        _GLIDES_MODULE + "glide_reach._fill_altitudes_left",
        "world.highest_ground._fill_cells",
    ),
}

# Units of a default plan, a flight and the glides of its report.  The shared units come first, so that two processes do
# not compile the same kernels; the first of them takes as long as the other two.  The others follow, the longest first.
_SHARED = ("problem", "tracking", "ranks")
# Units of a plan.
PLANNING = (*_SHARED, "scores", "shortening", "routes", "certificates", "paper", "sides")
# Units of a choice of plans: all units of a default plan, and its own.
FRONT_PLANNING = (*_SHARED, "scores", "shortening", "routes", "certificates", "fronts", "paper", "sides")
# Units of a flight.
FLYING = ("tracking", "flight")
# Units of glides without the engine.
GLIDING = ("glides",)
# Units of a plan and its flights.
PLANNING_AND_FLYING = (*_SHARED, "scores", "flight", "shortening", "routes", "certificates", "paper", "sides")


def list_unit_kernels(units: tuple[str, ...]) -> frozenset[str]:
    """Return the names of all kernels that the given units compile.

    >>> len(list_unit_kernels(("scores", "paper")))
    13
    """
    return frozenset(name for unit in units for name in UNIT_KERNELS[unit])
