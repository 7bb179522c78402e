"""Names of attachments in a log of anybody's are names and no paths: nothing is written by them, wherever they lead."""

import json
import os
from pathlib import Path

import pytest
from mcap.writer import Writer

from logs.recording.mcap_reader import MAGIC, Container, read_chunks
from logs.recording.reader import read_log
from planfly.cli import main
from tests.logs import log_copies
from tests.logs.log_copies import rewrite
from tests.logs.made_flight import make_setup, make_track, record

# Out of the folder, from the root, beyond a NUL, of a device, that turns text around, and none at all.
NAMES = ("../../x", "/x", "/proc/self/cwd/x", "a\0b", "..", "\u202egnp", "")
SECRET = b"written"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, three levels down, with a whole log and a cut one that hold the names, too."""
    deep = tmp_path / "a" / "b" / "c"
    deep.mkdir(parents=True)
    monkeypatch.chdir(deep)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "a"))
    plain = record(tmp_path / "plain.mcap", make_setup(), make_track(12.0))

    def with_names(out: object) -> Writer:
        writer = Writer(out, chunk_size=20_000)
        start = writer.start

        def start_and_attach(**given: str) -> None:
            start(**given)
            for name in NAMES:
                writer.add_attachment(0, 0, name, "text/plain", SECRET)

        writer.start = start_and_attach
        return writer

    with monkeypatch.context() as patch:
        patch.setattr(log_copies, "Writer", with_names)
        rewrite(plain, deep / "named.mcap", lambda item, _: item)
    plain.unlink()
    data = (deep / "named.mcap").read_bytes()
    (deep / "cut.mcap").write_bytes(data[: len(data) * 3 // 4])
    return deep


def files(folder: Path) -> set[str]:
    top = folder.parents[2]
    return {os.path.relpath(path, folder) for path in top.rglob("*") if path.is_file()}


def test_nothing_is_written_by_the_names_of_attachments(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = files(folder)
    assert read_log(folder / "named.mcap").complete
    assert main(["check", "named.mcap", "--json", "v.json"]) in (0, 4)
    assert main(["export", "named.mcap", "t.csv"]) == 0
    assert main(["replay", "named.mcap", "--speed", "1000"]) == 0
    assert main(["recover", "cut.mcap", "--out", "mended.mcap"]) == 3
    assert files(folder) - before == {"v.json", "t.csv", "mended.mcap"}
    assert not Path("/x").exists()
    capsys.readouterr()
    # A log that is mended holds them as they were, as names.
    file, found = (folder / "mended.mcap").open("rb"), Container()
    with file:
        file.seek(len(MAGIC))
        list(read_chunks(file, found))
    assert {name: found.attachments[name] for name in NAMES} == dict.fromkeys(NAMES, SECRET)
    assert found.problem == ""


def test_a_name_that_a_log_asks_for_and_lacks_is_shown_on_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def ask(item: object, name: str) -> object:
        if name == "setup.json":
            setup = json.loads(item.data)
            setup["sha256"]["../../x\n\x1b[31m"] = "0" * 64
            item.data = json.dumps(setup).encode()
        return item

    rewrite(folder / "named.mcap", folder / "asks.mcap", ask)
    assert main(["check", "asks.mcap"]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.isprintable()
    assert said.endswith("missing, although setup.json lists this attachment")
