from pathlib import Path

from robotcast.files import source_digest


def test_changed_code_has_another_digest_and_other_files_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "physics").mkdir()
    (tmp_path / "page").mkdir()
    module = tmp_path / "physics" / "drag.py"
    module.write_text("c = 1")
    before = source_digest("physics", root=tmp_path)
    (tmp_path / "page" / "html.py").write_text("h = 1")
    (tmp_path / "physics" / "drag.pyc").write_text("compiled")
    assert source_digest("physics", root=tmp_path) == before
    module.write_text("c = 2")
    assert source_digest("physics", root=tmp_path) != before
    module.write_text("c = 1")
    module.rename(module.with_name("wind.py"))
    assert source_digest("physics", root=tmp_path) != before


def test_the_digest_is_of_this_package() -> None:
    assert source_digest("simulators") == source_digest("simulators")
    assert source_digest("simulators") != source_digest("effects")
