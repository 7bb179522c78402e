"""The studio: a local page on which a mission is edited.

The mission is judged while it is dragged, and flown after each drag.
"""
