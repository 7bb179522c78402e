"""The package page's text: README.md with links that lead somewhere without the files beside it."""

import re
import tomllib
from pathlib import Path

from setuptools import setup

HERE = Path(__file__).parent
PROJECT = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\]]*)\]\((?P<file>(?!\w+:|#)[^)\s]+)\)")


def page_text(readme: str, repository: str, version: str) -> str:
    """README's text, its pictures and links as addresses in the repository at this version."""

    def absolute(link: "re.Match[str]") -> str:
        kind = "raw" if link["picture"] else "blob"
        return f"{link['picture']}[{link['text']}]({repository}/{kind}/v{version}/{link['file']})"

    return _LINK.sub(absolute, readme)


if __name__ == "__main__":
    setup(
        long_description=page_text(
            (HERE / "README.md").read_text(encoding="utf-8"), PROJECT["urls"]["Repository"], PROJECT["version"]
        ),
        long_description_content_type="text/markdown",
    )
