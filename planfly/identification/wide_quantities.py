"""Find the uncertain quantities of an identified aircraft.

Also find flights that would narrow their intervals.
"""

from dataclasses import dataclass

# Maximum half width of the sink's 95 % interval, as a fraction of the estimate; a wider interval makes it uncertain.
MAX_SINK_FRACTION = 0.10
# Maximum half width of the 95 % interval of the power in level flight, as a fraction of the estimate.
MAX_POWER_FRACTION = 0.20
# Duration of a glide at idle that narrows the interval of the sink more than half an hour of powered flight, s; from
# `benchmarks.identification_information`.
GLIDE_TIME_S = 20


@dataclass(frozen=True, slots=True)
class WideQuantity:
    """A quantity with a wide interval.

    title: "sink at idle" or "power in level flight".
    half: half the 95 % interval, as a fraction of the estimate.
    show: flights or logging that would narrow the interval.
    """

    title: str
    half: float
    show: str

    @property
    def text(self) -> str:
        """Description of the quantity, its interval, and the flight that would narrow the interval.

        >>> WideQuantity("sink at idle", 0.23, "glides").text
        'sink at idle: known only to ±23 %; to improve this, fly glides'
        """
        return f"{self.title}: known only to ±{100.0 * self.half:.0f} %; to improve this, fly {self.show}"


# Lower bound, estimate and upper bound of a quantity.
Interval = tuple[float, float, float]


def wide_quantities(sink: Interval, power: Interval, *, with_current: bool) -> tuple[WideQuantity, ...]:
    """Return those of the two quantities whose 95 % interval is too wide.

    The quantities are sink rate and power in level flight.

    sink, power: lower bound, estimate and upper bound, in any unit.
    with_current: True if the battery's current was logged, without which no manoeuvre narrows the power's interval.

    >>> [one.title for one in wide_quantities((6.0, 7.0, 8.0), (400.0, 500.0, 590.0), with_current=False)]
    ['sink at idle']
    """
    speed_runs = "level runs of 20 s at several speeds"
    wide = []
    for title, (lower, value, upper), limit, show in (
        ("sink at idle", sink, MAX_SINK_FRACTION, f"glides of {GLIDE_TIME_S} s at idle, at cruise speed"),
        (
            "power in level flight",
            power,
            MAX_POWER_FRACTION,
            speed_runs if with_current else "with the battery's current logged (BAT); without it no manoeuvre helps",
        ),
    ):
        half_width = 0.5 * (upper - lower) / abs(value)
        if half_width > limit:
            wide.append(WideQuantity(title, half_width, show))
    return tuple(wide)
