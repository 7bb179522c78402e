"""A damaged file of a compiled kernel is noticed, and the kernel is compiled again."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.world.test_kernels import _divide
from world import kernels
from world.kernel_files import CheckedCacheFiles

KEY = ("float64", "here")
OTHER = ("int64", "here")


@pytest.fixture
def files(tmp_path: Path) -> CheckedCacheFiles:
    files = CheckedCacheFiles(str(tmp_path), "module.kernel-1", (1.0, 2))
    files.save(KEY, "code of floats")
    files.save(OTHER, "code of integers")
    return files


def _saved(folder: Path) -> list[Path]:
    index, *data = sorted(folder.iterdir(), key=lambda path: path.suffix, reverse=True)
    assert index.suffix == ".nbi"
    assert len(data) == 2
    return [index, *sorted(data)]


def _damages(content: bytes) -> Iterator[bytes]:
    """Yield the content with a bit of each byte flipped, and cut at each byte."""
    for k in range(len(content)):
        flipped = bytearray(content)
        flipped[k] ^= 1 << k % 8
        yield bytes(flipped)
    yield from (content[:k] for k in range(len(content)))


def test_forms_are_kept_apart(files: CheckedCacheFiles) -> None:
    assert (files.load(KEY), files.load(OTHER), files.load("another")) == ("code of floats", "code of integers", None)


def test_a_flipped_bit_of_each_byte_and_every_cut_is_noticed(files: CheckedCacheFiles, tmp_path: Path) -> None:
    index, first, second = _saved(tmp_path)
    for path, lost in ((index, [KEY, OTHER]), (first, [KEY]), (second, [OTHER])):
        whole = path.read_bytes()
        for damaged in _damages(whole):
            path.write_bytes(damaged)
            assert [files.load(key) for key in lost] == [None] * len(lost)
        path.write_bytes(whole)
    assert files.load(KEY) == "code of floats"


def test_data_of_other_types_is_not_loaded(files: CheckedCacheFiles, tmp_path: Path) -> None:
    """An index that leads to the data of other types, as two processes may leave it, leads to no wrong code."""
    _, first, second = _saved(tmp_path)
    second.write_bytes(first.read_bytes())
    assert (files.load(KEY), files.load(OTHER)) == ("code of floats", None)


def _make_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


HARMS: dict[str, Callable[[Path], object]] = {
    "missing": Path.unlink,
    "empty": lambda path: path.write_bytes(b""),
    "another version": lambda path: path.write_bytes(b"0.0.1"),
    "a folder": _make_folder,
}


@pytest.mark.parametrize("harm", HARMS)
@pytest.mark.parametrize("which", [0, 1])
def test_a_harmed_kernel_is_compiled_and_saved_again(
    which: int, harm: str, files: CheckedCacheFiles, tmp_path: Path
) -> None:
    HARMS[harm](_saved(tmp_path)[which])
    assert files.load(KEY) is None
    files.save(KEY, "new code")
    # Nothing can be saved in place of a folder.
    assert files.load(KEY) == (None if harm == "a folder" else "new code")


def test_sources_of_another_time_are_not_loaded(files: CheckedCacheFiles, tmp_path: Path) -> None:
    later = CheckedCacheFiles(str(tmp_path), "module.kernel-1", (9.0, 2))
    assert later.load(KEY) is None
    assert files.load(KEY) == "code of floats"


def test_kernels_are_kept_in_files_with_digests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels._settings, "CACHE_DIR", str(tmp_path))
    compile_again = kernels._make_dispatcher

    def hits() -> int:
        kernel = compile_again(_divide.py_func)  # type: ignore[attr-defined]  # numba states no types
        assert kernel(7.0, 2.0) == 3.5
        return sum(kernel.stats.cache_hits.values())

    assert [hits(), hits()] == [0, 1]
    for path in [*tmp_path.rglob("*.nbi"), *tmp_path.rglob("*.nbc")]:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 16
        path.write_bytes(content)
        assert [hits(), hits()] == [0, 1]
