"""Texts for stations: ASCII, in pieces that join to the whole, the last of them not full."""

import pytest

from flight.live.status_text import WARNING, status_texts


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 399, 400, 500])
def test_pieces_join_to_the_text(length: int) -> None:
    text = ("0123456789" * 50)[:length]
    pieces = status_texts(text, WARNING, 3)
    assert "".join(piece.text for piece in pieces) == text[:400]
    assert all(piece.severity == WARNING for piece in pieces)
    if len(pieces) > 1:
        assert [(piece.id, piece.chunk_seq) for piece in pieces] == [(3, k) for k in range(len(pieces))]
        assert len(pieces[-1].text) < 50


def test_what_stations_cannot_show_is_replaced() -> None:
    (piece,) = status_texts("9° über 3 m", WARNING, 1)
    assert piece.text == "9 deg ?ber 3 m"
