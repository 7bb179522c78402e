"""``python -m making`` in docs/: update the generated tables of the pages."""

from pathlib import Path

from making.placeholders import fill_pages

fill_pages(Path(__file__).parents[1])
