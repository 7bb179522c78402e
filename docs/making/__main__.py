"""``python -m making`` in docs/: write the tables of the pages anew."""

from pathlib import Path

from making.placeholders import fill_pages

fill_pages(Path(__file__).parents[1])
