"""Blocks are read as they stand, and a block that does not run is noticed."""

from pathlib import Path

import pytest

from tests.docs.page_blocks import Bench, Block, blocks, parse

PAGE = """Text.

<!-- test: soak exit 4 -->
```sh
planfly fly a.waypoints \\
  --terrain jacksboro && echo go   # over the ridges
```

<!-- test: file a.toml -->
```toml
name = "a"
```
"""


def test_a_block_has_its_marks_its_line_and_its_commands(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE, encoding="utf-8")
    first, second = blocks(page)
    assert (first.line, first.exit_code, "soak" in first.marks) == (5, 4, True)
    assert first.commands == [["planfly", "fly", "a.waypoints", "--terrain", "jacksboro"]]
    assert (second.file, second.text) == ("a.toml", 'name = "a"\n')


def block(language: str, text: str) -> Block:
    return Block("page.md", 1, language, text, ())


def test_what_does_not_run_is_noticed(tmp_path: Path) -> None:
    bench = Bench(tmp_path)
    with pytest.raises(AssertionError, match=r"page\.md:1: fly missing\.plan: 2"):
        bench.run(block("sh", "planfly fly missing.plan\n"), {})
    with pytest.raises(AssertionError, match="is not run"):
        bench.run(block("sh", "mavproxy.py\n"), {})
    with pytest.raises(ZeroDivisionError):
        bench.run(block("python", "1 / 0\n"), {})


def test_an_option_that_is_none_is_noticed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(block("sh", "planfly serve --sped 20\n"))
    assert "--sped" in capsys.readouterr().err
