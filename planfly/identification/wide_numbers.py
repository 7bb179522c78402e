"""Quantities of an identified aircraft that its logs leave uncertain, and flights that would narrow them."""

from dataclasses import dataclass

# Either side of the estimate, as a share of it, from which on an interval (95 %) is wide.
WIDE_SINK = 0.10
WIDE_POWER = 0.20
# `benchmarks.identification_information`: a glide of so many seconds tells what half an hour of powered flight cannot.
GLIDE_SECONDS = 20


@dataclass(frozen=True, slots=True)
class WideNumber:
    """One of them.

    title: "sink at idle" or "power in level flight".  half: of its 95 % interval, as a share of the estimate.
    show: what would narrow it.
    """

    title: str
    half: float
    show: str

    @property
    def text(self) -> str:
        """In words.

        >>> WideNumber("sink at idle", 0.23, "glides").text
        'sink at idle: known to ±23 % only; fly glides'
        """
        return f"{self.title}: known to ±{100.0 * self.half:.0f} % only; fly {self.show}"


Interval = tuple[float, float, float]


def wide_numbers(sink: Interval, power: Interval, *, with_current: bool) -> tuple[WideNumber, ...]:
    """Return those of sink and power whose intervals (lower end, estimate, upper end) are wide.

    with_current: whether the battery's current was logged, without which nothing tells what the propeller takes.

    >>> [one.title for one in wide_numbers((6.0, 7.0, 8.0), (400.0, 500.0, 590.0), with_current=False)]
    ['sink at idle']
    """
    speeds = "level runs of 20 s at several speeds"
    made = []
    for title, (low, value, high), limit, show in (
        ("sink at idle", sink, WIDE_SINK, f"glides of {GLIDE_SECONDS} s at idle, at cruise speed"),
        (
            "power in level flight",
            power,
            WIDE_POWER,
            speeds if with_current else "with the battery's current logged (BAT); no manoeuvre does without it",
        ),
    ):
        half = 0.5 * (high - low) / abs(value)
        if half > limit:
            made.append(WideNumber(title, half, show))
    return tuple(made)
