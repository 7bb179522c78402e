"""What a build makes: the package page's text, of README.md without the files beside it; and plotly.js, packed.

The report's charts need that one script of 5 MB.  The package that brings it, with its Python 70 MB, is needed for the
build alone.
"""

import gzip
import re
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

HERE = Path(__file__).parent
# Where `logs.views.report.page` looks for it.
LIBRARY = HERE / "logs" / "views" / "report" / "plotly.min.js.gz"
# A picture or a link to a file; an address, and a place on the page, stay as they are.
_LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\]]*)\]\((?P<file>(?!\w+:|#)[^)\s]+)\)\n?")


def page_text(readme: str) -> str:
    """README's text without its pictures, and with the names of files in place of links to them."""

    def told(link: "re.Match[str]") -> str:
        if link["picture"]:
            return ""
        name = link["file"].partition("#")[0]
        end = "\n" if link[0].endswith("\n") else ""
        return (f"`{name}`" if link["text"] == name else f"{link['text']} (`{name}`)") + end

    return _LINK.sub(told, readme)


class BuildWithLibrary(build_py):
    """Packs plotly.js, as it is, into the packages before they are built."""

    def run(self) -> None:
        """Write the file, and build."""
        from plotly.offline import get_plotlyjs

        LIBRARY.write_bytes(gzip.compress(get_plotlyjs().encode("utf-8"), mtime=0))
        super().run()


if __name__ == "__main__":
    setup(
        cmdclass={"build_py": BuildWithLibrary},
        long_description=page_text((HERE / "README.md").read_text(encoding="utf-8")),
        long_description_content_type="text/markdown",
    )
