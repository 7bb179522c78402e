"""The table of the quantities that a table of columns can name, and of their units."""

from logs.importers.columns.quantities import QUANTITIES, UNITS


def quantity_table() -> str:
    """Return one row per quantity."""
    rows = ["| quantity | meaning | units | frames |", "|---|---|---|---|"]
    for name, quantity in QUANTITIES.items():
        units = " ".join(f"`{unit}`" for unit in UNITS[quantity.dimension] if unit)
        frames = " ".join(f"`{frame}`" for frame in quantity.frames)
        rows.append(f"| `{name}` | {quantity.meaning} | {units} | {frames} |")
    return "\n".join(rows)
