"""Page data of a verdict and of the profile."""

from logs.verdict.findings import make_finding
from logs.verdict.places import Place
from logs.verdict.verdict import Verdict
from planfly.studio.view_model import verdict_page_data


def test_a_flight_that_hits_the_ground_has_the_answer_of_its_headline() -> None:
    hit = make_finding("clearance", Place("leg", 2), ok=False, reason="touches the ground")
    words = "not flyable: clearance on leg 2"
    verdict = Verdict((hit,), flyable=False, complete=False, lines=(words,), level="flown")
    assert verdict_page_data(verdict)["answer"] == "not flyable"
