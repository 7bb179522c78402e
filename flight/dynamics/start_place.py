"""Where a flight may begin: on the globe, off its poles, in the air and below the tropopause."""

from world.errors import FlightError


def check_place(lat_deg: float, lon_deg: float, amsl: float, terrain_amsl: float) -> None:
    """Refuse a place where no flight begins.

    lat_deg, lon_deg: geodetic, degrees.  amsl: height, m.  terrain_amsl: of the ground there, m.  Raises FlightError.
    """
    if abs(lat_deg) >= 90.0 or abs(lon_deg) > 180.0:
        field, value = ("latitude", lat_deg) if abs(lat_deg) >= 90.0 else ("longitude", lon_deg)
        text = f"start at latitude {lat_deg}, longitude {lon_deg}: not within +-90 and +-180 degrees"
        raise FlightError(text, field=field, value=value, allowed="not within +-90 and +-180 degrees")
    if not terrain_amsl < amsl < 11000.0:
        allowed = f"not between ground ({terrain_amsl} m) and 11000 m"
        raise FlightError(f"start at {amsl} m above sea level: {allowed}", field="start", value=amsl, allowed=allowed)
