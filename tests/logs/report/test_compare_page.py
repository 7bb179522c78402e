"""The comparison's pictures and page: whole, with both verdicts, the same bytes each time."""

from pathlib import Path
from xml.etree import ElementTree

from logs.recording.reader import FlightLog, read_log
from logs.report.compare import compare_logs
from logs.report.compare_page import write_comparison


def test_pictures_and_page_are_whole_and_the_same_bytes_each_time(
    log_file: Path, other: FlightLog, tmp_path: Path
) -> None:
    found = compare_logs(read_log(log_file), other, names=("a.mcap", "b.mcap"))
    files = write_comparison(tmp_path / "out", found, svg=True)
    assert [file.name for file in files] == [
        "compare-map.png", "compare-profile.png", "compare-map.svg", "compare-profile.svg", "compare.html",
    ]  # fmt: skip
    first = [file.read_bytes() for file in files]
    assert all(data.startswith(b"\x89PNG") for data in first[:2])
    assert all(ElementTree.fromstring(data).tag.endswith("svg") for data in first[2:4])
    assert b"energy used" in first[4]
    # Both verdicts in a sentence first, and the pictures inside: the page can be sent alone.
    page = first[4].decode("utf-8")
    assert 0 < page.index("a.mcap:</strong>") < page.index("b.mcap:</strong>") < page.index("<table")
    assert page.count("data:image/png;base64,") == 2
    assert 'src="compare' not in page
    assert [file.read_bytes() for file in write_comparison(tmp_path / "out", found, svg=True)] == first
