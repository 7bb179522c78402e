"""Captions of the pictures that were drawn, and of no others, fitting what was flown."""

import base64

from logs.figures.draw_all import FIGURE_FILES
from logs.report.captions import report_pictures
from tests.logs.report.report_data import make_setup

NAMES = (*FIGURE_FILES, "time", "exposure", "controls", "energy")
DRAWN = {f"{name}.png": name.encode() for name in NAMES}


def test_every_picture_that_is_drawn_has_its_caption_and_its_bytes() -> None:
    pictures = report_pictures(make_setup(), True, DRAWN)
    assert sorted(picture.identifier for picture in pictures) == sorted(NAMES)
    for picture in pictures:
        head, _, data = picture.data.partition(",")
        assert head == "data:image/png;base64"
        assert base64.b64decode(data) == picture.identifier.encode()
        assert picture.title
        assert len(picture.alternative) > 30
        assert len(picture.caption) > 30
    assert len({picture.title for picture in pictures}) == len({picture.caption for picture in pictures}) == len(NAMES)
    assert pictures[0].identifier == "map"


def test_what_was_not_drawn_is_left_out_in_the_same_order() -> None:
    whole = [picture.identifier for picture in report_pictures(make_setup(), True, DRAWN)]
    some = {name: data for name, data in DRAWN.items() if name not in ("scene.png", "time.png")}
    left = [picture.identifier for picture in report_pictures(make_setup(), True, some)]
    assert left == [name for name in whole if name not in ("scene", "time")]
    assert report_pictures(make_setup(), True, {}) == []


def test_a_plan_alone_is_not_said_to_have_been_flown() -> None:
    setup = make_setup(terrain={"kind": "none"}, threats=[])
    drawn = {name: DRAWN[name] for name in ("map.png", "profile.png", "scene.png")}
    flown, planned = report_pictures(make_setup(), True, drawn), report_pictures(setup, False, drawn)
    assert all("flown" in picture.alternative for picture in flown)
    assert not any("flown" in picture.alternative for picture in planned)
    # Three legs and one unit over terrain; the other has neither.
    assert "shaded terrain, 1 threats, the planned path of 3 legs" in flown[0].alternative
    assert "no terrain, 0 threats, the planned path of 3 legs." in planned[0].alternative
