"""Views of a flight: charts, pictures and pages, each drawn from one description; replays; and exports."""
